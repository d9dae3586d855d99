// SPDX-License-Identifier: BSD-3-Clause
// The skin of a hand: one closed mesh around the limbs of the simulation and a palm of its own, made from the hand's
// measures. The surface is where a distance function is zero: tapered capsules along the bones, metacarpals in the palm,
// forearm, joined smoothly. Each vertex hangs on the bones near to it (linear blend skinning); the hand at rest has
// slightly bent, spread fingers, so that joints fold well. Units: metres, frame of the palm (x to the fingers, y to
// the thumb of a right hand, z out of the back). Pure: no three.js, no page.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]], sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s], dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const mix = (a, b, t) => a + (b - a) * t, clamp = (x, low, high) => Math.min(high, Math.max(low, x));
const smooth = (low, high, x) => { const t = clamp((x - low) / (high - low), 0, 1); return t * t * (3 - 2 * t); };

// Quaternions w x y z, as in the messages.
export function multiply(a, b) {
  return [a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]];
}
export const inverse = q => [q[0], -q[1], -q[2], -q[3]];
export const rotate = (q, v) => multiply(multiply(q, [0, ...v]), inverse(q)).slice(1);
const about = (axis, angle) => [Math.cos(angle / 2), ...scale(axis, Math.sin(angle / 2))];

// How far behind the wrist the forearm ends, in a band.
export const CUT = 0.05;
export const PALM = 15, FOREARM = 16, BONES = 17;

// Thumb at rest: its metacarpal out to the side, abduction 0 of hand.c's skeleton. Fingers: spread about z, bent about y.
const THUMB = [0.4061, -0.7591, -0.21, 0.4635];
const SPREAD = [0, 0.2, 0.03, -0.16, -0.38], BENT = [0.22, 0.35, 0.2];

// The hand's measures out of the shapes and of one state: radii and half lengths of the 15 limbs, the palm's box, where
// each finger and the wrist begin in the palm's frame. `left`: mirrored in y. folder: "hand::", or a second hand's.
export function measure(links, state, folder) {
  const limbs = links.filter(link => link.name.startsWith(folder)).map(link => link.geom[0]);
  const radius = [], half = [];
  for (const geom of limbs.slice(0, PALM)) {
    radius.push(geom.float_data[0]);
    half.push(geom.float_data[1] / 2);
  }
  const palm = state.limb[PALM], into = inverse(palm.driver_quaternion);
  const inPalm = p => rotate(into, sub(p, palm.driver_position_m));
  const base = [0, 1, 2, 3, 4].map(f => {
    const limb = state.limb[3 * f];
    return inPalm(add(limb.driver_position_m, rotate(limb.driver_quaternion, [-half[3 * f], 0, 0])));
  });
  const left = base[1][1] < base[4][1];
  if (left) for (const p of base) p[1] = -p[1];
  const wrist = inPalm(state.wrist_position_m);
  return {radius, half, base, left, wrist: left ? [wrist[0], -wrist[1], wrist[2]] : wrist, palm: box(limbs[PALM].float_data)};
}

// The palm's mesh is a box with a sphere of `radius` at each corner: its extents tell the box.
function box(numbers) {
  const extent = [0, 0, 0], radius = 0.01;
  for (let i = 0; i < numbers[0]; i++) for (let k = 0; k < 3; k++) extent[k] = Math.max(extent[k], Math.abs(numbers[2 + 3 * i + k]));
  return {half: extent.map(x => Math.max(0, x - 0.966 * radius)), radius};
}

// Every bone at rest: {p, q} in the palm's frame.
export function rest(hand) {
  const bones = [];
  for (let f = 0; f < 5; f++) {
    let q = f ? about([0, 0, 1], SPREAD[f]) : THUMB, p = hand.base[f];
    for (let s = 0; s < 3; s++) {
      if (f) q = multiply(q, about([0, 1, 0], BENT[s]));
      else if (s) q = multiply(q, about([0, 1, 0], 0.15));
      const along = rotate(q, [hand.half[3 * f + s], 0, 0]);
      bones.push({p: add(p, along), q});
      p = add(p, scale(along, 2));
    }
  }
  bones.push({p: [0, 0, 0], q: [1, 0, 0, 0]}, {p: hand.wrist, q: [1, 0, 0, 0]});
  return bones;
}

// ---- distance -------------------------------------------------------------------------------------------------------

function capsule(p, c) {
  const to = sub(p, c.a), t = clamp(dot(to, c.along) / c.length2, 0, 1);
  const x = to[0] - t * c.along[0], y = to[1] - t * c.along[1], z = to[2] - t * c.along[2];
  return Math.sqrt(x * x + y * y + z * z) - mix(c.ra, c.rb, t);
}
const makeCapsule = (a, b, ra, rb) => ({a, ra, rb, along: sub(b, a), length2: dot(sub(b, a), sub(b, a)) || 1e-12});
// Joined with a fillet of size k.
function join(a, b, k) {
  const h = Math.max(k - Math.abs(a - b), 0) / k;
  return Math.min(a, b) - h * h * k / 4;
}

// Parts of the hand at rest, and the distance of a point to each.
export class Shape {
  constructor(hand, bones) {
    const {radius: r, half} = hand;
    this.limbs = bones.slice(0, PALM).map(({p, q}, i) => {
      const along = rotate(q, [half[i], 0, 0]), s = i % 3;
      return makeCapsule(sub(p, along), add(p, along), s ? (r[i - 1] + r[i]) / 2 : r[i], s < 2 ? (r[i] + r[i + 1]) / 2 : r[i]);
    });
    this.box = hand.palm;
    const w = hand.wrist;
    this.wrist = w;
    this.metacarpals = [1, 2, 3, 4].map(f => {
      const to = hand.base[f], from = [w[0] + 0.014, mix(w[1], to[1], 0.45), 0];
      return makeCapsule(from, to, this.box.radius + 0.002, r[3 * f] + 0.0012);
    });
    const thumb = this.limbs[0];
    this.ball = makeCapsule([w[0] + 0.02, w[1] + 0.008, -0.002], add(thumb.a, scale(thumb.along, 0.55)), 0.012, r[0] + 0.001);
    this.heel = makeCapsule([w[0] + 0.018, w[1] - 0.014, -0.001], [hand.base[4][0] - 0.012, hand.base[4][1] + 0.002, -0.001], 0.0125, 0.011);
  }

  palm(p) {
    const narrow = mix(0.66, 1, smooth(-this.box.half[0] - 0.008, 0.012, p[0]));
    const x = Math.max(0, Math.abs(p[0]) - this.box.half[0] + 0.004), y = Math.max(0, Math.abs(p[1] / narrow) - this.box.half[1]);
    const z = Math.max(0, Math.abs(p[2]) - this.box.half[2]);
    let d = Math.hypot(x, y, z) - this.box.radius;
    for (const c of this.metacarpals) d = join(d, capsule(p, c), 0.008);
    d = join(d, capsule(p, this.ball), 0.010);
    return join(d, capsule(p, this.heel), 0.008);
  }

  forearm(p) {
    const out = Math.max(0, this.wrist[0] - p[0]), wide = 1.55 + 1.2 * out;
    const y = (p[1] - this.wrist[1]) / wide, x = Math.max(0, p[0] - this.wrist[0] - 0.006);
    return Math.hypot(x, y, p[2]) - 0.0165 - 0.06 * out;
  }

  finger(p, f) {
    const [a, b, c] = [0, 1, 2].map(s => capsule(p, this.limbs[3 * f + s]));
    return join(join(a, b, 0.003), c, 0.003);
  }

  at(p) {
    let fingers = this.finger(p, 1);
    for (let f = 2; f < 5; f++) fingers = join(fingers, this.finger(p, f), 0.0015);
    let d = join(this.palm(p), fingers, 0.007);
    d = join(d, this.finger(p, 0), 0.011);
    d = join(d, this.forearm(p), 0.016);
    return Math.max(d, this.wrist[0] - CUT - p[0]); // the forearm ends here
  }

  gradient(p) {
    const e = 2e-4, g = [0, 1, 2].map(k => {
      const more = p.slice(), less = p.slice();
      more[k] += e;
      less[k] -= e;
      return this.at(more) - this.at(less);
    });
    return scale(g, 1 / (Math.hypot(...g) || 1));
  }
}

// ---- surface --------------------------------------------------------------------------------------------------------

// Values of the function on a grid; far from the surface (by a coarse look first) only the sign is right.
function sample(shape, low, count, step) {
  const block = 5, value = new Float32Array(count[0] * count[1] * count[2]);
  const at = (i, j, k) => [low[0] + i * step, low[1] + j * step, low[2] + k * step], reach = 0.95 * block * step;
  for (let i = 0; i < count[0]; i += block) for (let j = 0; j < count[1]; j += block) for (let k = 0; k < count[2]; k += block) {
    const coarse = shape.at(at(i + block / 2, j + block / 2, k + block / 2)), far = Math.abs(coarse) > reach;
    for (let a = i; a < Math.min(i + block, count[0]); a++) for (let b = j; b < Math.min(j + block, count[1]); b++)
      for (let c = k; c < Math.min(k + block, count[2]); c++) value[(a * count[1] + b) * count[2] + c] = far ? coarse : shape.at(at(a, b, c));
  }
  return value;
}

// Surface nets: a vertex in each cell that the surface crosses, a quad around each edge that crosses it.
function nets(value, low, count, step) {
  const [, ny, nz] = count, stride = [ny * nz, nz, 1], vertex = new Map(), points = [], faces = [];
  const corners = Array.from({length: 8}, (_, n) => [n & 1, n >> 1 & 1, n >> 2]);
  const edges = [];
  for (let n = 0; n < 8; n++) for (const bit of [1, 2, 4]) if (!(n & bit)) edges.push([n, n | bit]);
  const offset = corners.map(([x, y, z]) => x * stride[0] + y * stride[1] + z);
  for (let i = 0; i + 1 < count[0]; i++) for (let j = 0; j + 1 < ny; j++) for (let k = 0; k + 1 < nz; k++) {
    const cell = i * stride[0] + j * stride[1] + k, inside = offset.map(o => value[cell + o] < 0);
    if (inside.every(x => x === inside[0])) continue;
    let sum = [0, 0, 0], n = 0;
    for (const [a, b] of edges) {
      if (inside[a] === inside[b]) continue;
      const va = value[cell + offset[a]], t = va / (va - value[cell + offset[b]]);
      sum = add(sum, corners[a].map((x, m) => mix(x, corners[b][m], t)));
      n++;
    }
    vertex.set(cell, points.length);
    points.push([i, j, k].map((x, m) => low[m] + (x + sum[m] / n) * step));
  }
  for (const cell of vertex.keys()) for (let axis = 0; axis < 3; axis++) {
    const [u, v] = [stride[(axis + 1) % 3], stride[(axis + 2) % 3]];
    const here = value[cell] < 0;
    if (here === value[cell + stride[axis]] < 0) continue;
    const quad = [cell, cell - u, cell - u - v, cell - v].map(c => vertex.get(c));
    if (quad.some(x => x === undefined)) continue;
    const [a, b, c, d] = here ? quad : quad.slice().reverse();
    faces.push([a, b, c], [a, c, d]);
  }
  return {points, faces};
}

// ---- weights --------------------------------------------------------------------------------------------------------

// Of each bone, 17 numbers: the nearest limb and its neighbours in the chain, by how much farther they are.
function weigh(shape, p) {
  const d = new Array(BONES).fill(Infinity), w = new Array(BONES).fill(0);
  for (let i = 0; i < PALM; i++) d[i] = capsule(p, shape.limbs[i]);
  d[PALM] = shape.palm(p);
  let nearest = 0;
  for (let i = 0; i <= PALM; i++) if (d[i] < d[nearest]) nearest = i;
  const allowed = nearest === PALM ? [PALM, 0, 3, 6, 9, 12] : [nearest];
  if (nearest < PALM) {
    allowed.push(nearest % 3 ? nearest - 1 : PALM);
    if (nearest % 3 < 2) allowed.push(nearest + 1);
  }
  for (const i of allowed) {
    const soft = i === PALM || nearest === PALM ? (i === 0 || nearest === 0 ? 0.006 : 0.0035) : 0.0018;
    w[i] = Math.exp(-(d[i] - d[nearest]) / soft);
  }
  const arm = smooth(shape.wrist[0] + 0.014, shape.wrist[0] - 0.014, p[0]);
  return normalized(w.map((x, i) => i === FOREARM ? 0 : x)).map((x, i) => i === FOREARM ? arm : x * (1 - arm));
}
function normalized(w) {
  const sum = w.reduce((a, b) => a + b, 0) || 1;
  return w.map(x => x / sum);
}

function smoothed(weights, faces, rounds) {
  const around = weights.map(() => new Set());
  for (const [a, b, c] of faces) {
    around[a].add(b).add(c);
    around[b].add(a).add(c);
    around[c].add(a).add(b);
  }
  for (; rounds > 0; rounds--)
    weights = weights.map((w, i) => {
      const near = [...around[i]];
      return w.map((x, bone) => 0.5 * x + 0.5 * near.reduce((sum, n) => sum + weights[n][bone], 0) / (near.length || 1));
    });
  return weights;
}

// The four heaviest bones.
function heaviest(w) {
  const four = w.map((x, i) => [x, i]).sort((a, b) => b[0] - a[0]).slice(0, 4), sum = four.reduce((s, [x]) => s + x, 0);
  return {bone: four.map(([, i]) => i), weight: four.map(([x]) => x / sum)};
}

// ---- colour ---------------------------------------------------------------------------------------------------------

// What the skin's colour is multiplied by: nails lighter, tips and the inside of the hand a little warmer.
function tint(shape, bones, hand, p, normal) {
  for (let f = 0; f < 5; f++) {
    const i = 3 * f + 2, local = rotate(inverse(bones[i].q), sub(p, bones[i].p)), up = rotate(inverse(bones[i].q), normal)[2];
    const r = hand.radius[i], x = (local[0] - hand.half[i] * 0.75) / (0.95 * r), y = local[1] / (0.72 * r);
    if (up > 0.25 && local[2] > 0 && x * x + y * y < 1) return [1.04, 0.93, 0.93];
    if (capsule(p, shape.limbs[i]) < 0.002) {
      const tip = smooth(-0.5, 1, local[0] / (hand.half[i] + r));
      return [1, 1 - 0.10 * tip, 1 - 0.12 * tip];
    }
  }
  const inside = smooth(0, -0.8, normal[2]);
  return [1, 1 - 0.05 * inside, 1 - 0.06 * inside];
}

// The whole: positions, normals, colours (flat lists), faces, and four bones with weights for each vertex.
export function makeSkin(hand, step = 0.0022) {
  const bones = rest(hand), shape = new Shape(hand, bones), low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  const grow = (p, r) => p.forEach((x, k) => { low[k] = Math.min(low[k], x - r); high[k] = Math.max(high[k], x + r); });
  for (const c of shape.limbs) {
    grow(c.a, 0.02);
    grow(add(c.a, c.along), 0.02);
  }
  grow([hand.wrist[0] - CUT, hand.wrist[1], 0], 0.04);
  const count = low.map((x, k) => Math.ceil((high[k] - x) / step) + 1);
  const {points, faces} = nets(sample(shape, low, count, step), low, count, step);
  for (let round = 0; round < 2; round++)
    points.forEach((p, i) => { points[i] = sub(p, scale(shape.gradient(p), shape.at(p))); });
  const normals = points.map(p => shape.gradient(p));
  const weights = smoothed(points.map(p => weigh(shape, p)), faces, 3).map(heaviest);
  const colors = points.map((p, i) => tint(shape, bones, hand, p, normals[i]));
  return mirrored({bones, points, normals, faces, colors, weights}, hand.left);
}

function mirrored(skin, left) {
  if (!left) return skin;
  const flip = v => [v[0], -v[1], v[2]];
  return {...skin, bones: skin.bones.map(({p, q}) => ({p: flip(p), q: [q[0], -q[1], q[2], -q[3]]})), points: skin.points.map(flip),
    normals: skin.normals.map(flip), faces: skin.faces.map(([a, b, c]) => [a, c, b])};
}
