// SPDX-License-Identifier: BSD-3-Clause
// A run over time, live or out of a log: its states by their time (`second` of one is the second hand's of that step), the shapes that belong to them, and the forces of
// the whole as plain numbers for the strips. Field names are those of data/lcm.
import {decode, index} from "./lcm.js";

export const FINGERS = ["thumb", "index", "middle", "ring", "little"];
export const SAFETY = ["start", "wait", "ready", "armed", "active", "fault", "stopped"];
const LIVE_S = 120, ABSURD_N = 1000; // a force beyond it is a damaged message's

// Forces of five fingers over time: `t`, and for each kind five lists.
class Curves {
  constructor() {
    this.t = [];
    for (const kind of ["commanded", "measured"]) this[kind] = FINGERS.map(() => []);
  }

  add(state) {
    this.t.push(state.time_s);
    for (let i = 0; i < FINGERS.length; i++) {
      this.commanded[i].push(state.force_commanded_n[i]);
      this.measured[i].push(state.force_measured_n[i]);
    }
  }

  forget(count) {
    this.t.splice(0, count);
    for (const list of [...this.commanded, ...this.measured]) list.splice(0, count);
  }
}

// The last entry at or before `time` (the first one where there is none).
function before(times, time) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}

class Run {
  constructor(name) {
    this.name = name;
    this.about = null;
    this.load = null;
    this.strongest_n = 0;
    this.curves = new Curves();
    this.second_curves = new Curves(); // of the second hand
  }

  addCurves(state) {
    this.curves.add(state);
    if (state.second) this.second_curves.add(state.second);
  }

  // The strongest force of the contacts of one limb, at any time.
  measure(state) {
    if (state.second) this.measure(state.second);
    const sum = new Map();
    for (const {limb, force_n} of state.contact) {
      if (limb < 0) continue;
      const f = sum.get(limb) ?? [0, 0, 0];
      force_n.forEach((x, k) => { f[k] += x; });
      sum.set(limb, f);
    }
    for (const f of sum.values()) {
      const n = Math.hypot(...f);
      if (n < ABSURD_N) this.strongest_n = Math.max(this.strongest_n, n);
    }
  }

  get empty() { return !this.curves.t.length; }
  get begin() { return this.curves.t[0] ?? 0; }
  get end() { return this.curves.t[this.curves.t.length - 1] ?? 0; }

  // The two states around `time`, and how far between them it lies.
  around(time) {
    const t = this.curves.t, i = before(t, time), next = Math.min(i + 1, t.length - 1), gap = t[next] - t[i];
    return {a: this.state(i), b: this.state(next), part: gap > 0 ? Math.min(1, Math.max(0, (time - t[i]) / gap)) : 0};
  }
}

export class LiveRun extends Run {
  constructor() {
    super("live");
    this.states = [];
    this.arrived = 0;
  }

  state(i) { return this.states[i]; }
  loadAt() { return this.load; }

  // True where another run of gloved has begun.
  add(state, now) {
    const begun = state.time_s < this.end || this.empty;
    if (state.time_s < this.end) {
      this.states = [];
      this.curves = new Curves();
      this.second_curves = new Curves();
      this.strongest_n = 0;
    }
    this.measure(state);
    this.arrived = now;
    this.states.push(state);
    this.addCurves(state);
    const old = before(this.curves.t, state.time_s - LIVE_S);
    if (old > 200) {
      this.states.splice(0, old);
      this.curves.forget(old);
      const begin = this.begin;
      this.second_curves.forget(this.second_curves.t.filter(t => t < begin).length);
    }
    return begun;
  }
}

export class LogRun extends Run {
  // Throws an Error in words where there is nothing to show.
  constructor(name, buffer, layouts) {
    super(name);
    Object.assign(this, {buffer, layouts, damaged: 0, at: [], second: null, seconds: [], loads: [], shown: new Map()});
    const found = index(buffer);
    for (const message of found.messages) this.take(message);
    if (this.empty) throw new Error(`${name}: ${this.why || (found.messages.length ? "no GLOVED_STATE in it; record it with gloved --log" : "no LCM log")}`);
    this.damaged += found.skipped > 0 ? 1 : 0;
  }

  take(message) {
    try {
      if (message.channel === "GLOVED_STATE") this.takeState(message);
      else if (message.channel === "GLOVED_STATE2") this.second = {message, state: this.decode("state_t", message)};
      else if (message.channel === "DRAKE_VIEWER_LOAD_ROBOT") this.takeLoad(message);
      else if (message.channel === "GLOVED_ABOUT") this.about = this.decode("about_t", message);
    } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      this.damaged++;
      this.why = error.message;
    }
  }

  decode(type, {at, length}) { return decode(this.layouts, type, new DataView(this.buffer, at, length)); }

  takeState(message) {
    const state = this.decode("state_t", message), own = this.second?.state.step === state.step;
    if (!(state.time_s >= this.end)) return; // a log has one run
    if (own) state.second = this.second.state;
    this.seconds.push(own ? this.second.message : null);
    this.at.push(message);
    this.addCurves(state);
    this.measure(state);
  }

  takeLoad(message) {
    const last = this.loads[this.loads.length - 1];
    if (last && last.length === message.length) return; // once a second, always the same
    this.loads.push({length: message.length, from: this.end, links: this.decode("viewer_load_t", message).link});
  }

  loadAt(time) {
    const fits = this.loads.filter(load => load.from <= time);
    return (fits.pop() ?? this.loads[0])?.links ?? null;
  }

  state(i) {
    if (!this.shown.has(i)) {
      if (this.shown.size > 500) this.shown.clear();
      const state = this.decode("state_t", this.at[i]), second = this.seconds[i];
      if (second) state.second = this.decode("state_t", second);
      this.shown.set(i, state);
    }
    return this.shown.get(i);
  }
}
