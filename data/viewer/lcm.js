// SPDX-License-Identifier: BSD-3-Clause
// LCM in the page: messages and logs, by the layouts that the server tells of data/lcm (name -> fingerprint and fields).
// What is damaged is left out and counted.

const SYNC = 0xEDA1DA01, HEADER = 28, MESSAGE_MAX = 1 << 24;
const SIZE = {int8_t: 1, int16_t: 2, int32_t: 4, int64_t: 8, float: 4, double: 8, boolean: 1, byte: 1};
const GET = {
  int8_t: (view, at) => view.getInt8(at), int16_t: (view, at) => view.getInt16(at), int32_t: (view, at) => view.getInt32(at),
  int64_t: (view, at) => Number(view.getBigInt64(at)), float: (view, at) => view.getFloat32(at), double: (view, at) => view.getFloat64(at),
  boolean: (view, at) => view.getUint8(at) !== 0, byte: (view, at) => view.getUint8(at),
};

class Cursor {
  constructor(layouts, view) { this.layouts = layouts; this.view = view; this.at = 8; }

  text() {
    const length = this.view.getInt32(this.at);
    if (length < 1) throw new RangeError("a text of no length");
    const bytes = new Uint8Array(this.view.buffer, this.view.byteOffset + this.at + 4, length - 1);
    this.at += 4 + length;
    return new TextDecoder().decode(bytes);
  }

  one(type) {
    if (type === "string") return this.text();
    if (!SIZE[type]) return this.struct(type);
    const value = GET[type](this.view, this.at);
    this.at += SIZE[type];
    return value;
  }

  many(type, sizes, depth) {
    if (depth === sizes.length) return this.one(type);
    if (!(sizes[depth] >= 0 && sizes[depth] <= this.view.byteLength)) throw new RangeError("a list of impossible length");
    return Array.from({length: sizes[depth]}, () => this.many(type, sizes, depth + 1));
  }

  struct(name) {
    const out = {};
    for (const [field, type, dimensions] of this.layouts[name].fields)
      out[field] = this.many(type, (dimensions || []).map(size => typeof size === "string" ? out[size] : size), 0);
    return out;
  }
}

// One message as an object with the fields' names; throws RangeError where it cannot be one.
export function decode(layouts, name, view) {
  const fingerprint = view.getBigUint64(0).toString(16).padStart(16, "0");
  if (fingerprint !== layouts[name].fingerprint) throw new RangeError(`${name} of another version of gloved`);
  return new Cursor(layouts, view).struct(name);
}

// Where each message lies: [{channel, at, length}].
export function index(buffer) {
  const view = new DataView(buffer), found = [], names = new TextDecoder();
  let at = 0, skipped = 0;
  while (at + HEADER <= buffer.byteLength) {
    const channel = view.getInt32(at + 20), length = view.getInt32(at + 24), data = at + HEADER + channel;
    const sound = view.getUint32(at) === SYNC && channel > 0 && channel < 64 && length >= 8 && length < MESSAGE_MAX;
    if (!sound || data + length > buffer.byteLength) {
      at += 1;
      skipped += 1;
      continue;
    }
    found.push({channel: names.decode(new Uint8Array(buffer, at + HEADER, channel)), at: data, length});
    at = data + length;
  }
  return {messages: found, skipped: skipped + buffer.byteLength - at};
}
