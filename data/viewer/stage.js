// SPDX-License-Identifier: BSD-3-Clause
// One run in 3D: table and objects with their edges, the simulated hand (or both) in its skin, the measured one as thin lines
// where it differs, forces as arrows, contacts and touched polygons. Drawn with three.js (Debian's libjs-three).
import * as THREE from "/three.js";
import {BONES, CUT, FOREARM, PALM, inverse, makeSkin, measure, multiply, rotate} from "./skin.js";

// Arrows: metres a newton, the first with which the strongest force of the run stays below ARROW_M.
const SCALES_M_PER_N = [0.025, 0.01, 0.005, 0.0025, 0.001], ARROW_M = 0.12;
export const forceScale = strongest_n => SCALES_M_PER_N.find(s => s * strongest_n <= ARROW_M) ?? SCALES_M_PER_N[SCALES_M_PER_N.length - 1];

const SKIN = "#cf9273", STATIC = "#c9ccd1", PAINT = ["#2f7fb5", "#8f9e3c", "#7d66b0", "#cc7f35"];
const FORCE = "#118a3a", CONTACT = "#d7263d", POLYGON = "#ffb000", GLOVE = "#1f4fd8";
const FOLDERS = ["hand::", "hand2::"]; // of the shapes
const CONTACTS = 96, POLYGONS = 48;
const MANY = 3000; // corners, from which on a mesh is round and has no edges but sharp ones
const DIFFERS_M = 0.0008, DIFFERS_RAD = 0.03;

export const color = hex => new THREE.Color(hex).convertSRGBToLinear();
const vector = v => new THREE.Vector3(v[0], v[1], v[2]);
const quaternion = q => new THREE.Quaternion(q[1], q[2], q[3], q[0]);

// The back of what is drawn, 0.35 mm larger, in a dark colour.
const OUTLINE = new THREE.ShaderMaterial({side: THREE.BackSide,
  vertexShader: "void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position + 0.00035 * normal, 1.0); }",
  fragmentShader: "void main() { gl_FragColor = vec4(0.06, 0.14, 0.2, 1.0); }"});

// ---- shapes of the messages -----------------------------------------------------------------------------------------

// Triangles of a mesh with normals: smooth where faces meet at less than 40 degrees.
function meshGeometry(numbers) {
  const [v, t] = numbers, at = 2 + 3 * v, p = numbers.slice(2, at), corner = numbers.slice(at), around = Array.from({length: v}, () => []);
  const normals = new Float64Array(3 * t), sizes = new Float64Array(t), position = new Float32Array(9 * t), normal = new Float32Array(9 * t);
  for (let f = 0; f < t; f++) {
    const [a, b, c] = [3 * corner[3 * f], 3 * corner[3 * f + 1], 3 * corner[3 * f + 2]];
    const u = [p[b] - p[a], p[b + 1] - p[a + 1], p[b + 2] - p[a + 2]], w = [p[c] - p[a], p[c + 1] - p[a + 1], p[c + 2] - p[a + 2]];
    const n = [u[1] * w[2] - u[2] * w[1], u[2] * w[0] - u[0] * w[2], u[0] * w[1] - u[1] * w[0]];
    normals.set(n, 3 * f);
    sizes[f] = Math.hypot(...n);
    for (let k = 0; k < 3; k++) around[corner[3 * f + k]].push(f);
  }
  for (let f = 0; f < t; f++) for (let k = 0; k < 3; k++) {
    const i = corner[3 * f + k], sum = [0, 0, 0];
    for (const g of around[i]) {
      const cos = normals[3 * f] * normals[3 * g] + normals[3 * f + 1] * normals[3 * g + 1] + normals[3 * f + 2] * normals[3 * g + 2];
      if (cos > 0.766 * sizes[f] * sizes[g]) for (let m = 0; m < 3; m++) sum[m] += normals[3 * g + m];
    }
    const length = Math.hypot(...sum) || 1;
    position.set([p[3 * i], p[3 * i + 1], p[3 * i + 2]], 9 * f + 3 * k);
    normal.set(sum.map(x => x / length), 9 * f + 3 * k);
  }
  return geometryOf(position, normal);
}

function geometryOf(position, normal) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(position), 3));
  geometry.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(normal), 3));
  return geometry;
}

// The coplanar triangles around the point of a mesh (in its frame) as a geometry: the polygon that is touched.
function polygonAt(geometry, point) {
  const p = geometry.getAttribute("position"), corner = i => new THREE.Vector3().fromBufferAttribute(p, i);
  const triangle = i => new THREE.Triangle(corner(3 * i), corner(3 * i + 1), corner(3 * i + 2)), near = new THREE.Vector3();
  let best = 0, least = Infinity;
  for (let i = 0; i < p.count / 3; i++) {
    triangle(i).closestPointToPoint(point, near);
    const d = near.distanceToSquared(point);
    if (d < least) { least = d; best = i; }
  }
  const plane = triangle(best).getPlane(new THREE.Plane()), normal = plane.normal.toArray(), position = [];
  for (let i = 0; i < p.count / 3; i++) {
    const t = triangle(i);
    if (t.getNormal(near).dot(plane.normal) < 0.9999 || Math.abs(plane.distanceToPoint(t.a)) > 1e-5) continue;
    for (const c of [t.a, t.b, t.c]) position.push(...c.addScaledVector(plane.normal, 2e-4).toArray());
  }
  return geometryOf(position, Array.from({length: position.length}, (_, i) => normal[i % 3]));
}

// ---- thin lines of the measured hand --------------------------------------------------------------------------------

// A capsule along x: rings where the caps begin, lines along it, an arc over each end.
function capsuleLines(radius, half) {
  const out = [], ring = 16, put = (x, a) => out.push(x, radius * Math.cos(a), radius * Math.sin(a));
  for (const x of [-half, half]) for (let k = 0; k < ring; k++) {
    put(x, 2 * Math.PI * k / ring);
    put(x, 2 * Math.PI * (k + 1) / ring);
  }
  for (let k = 0; k < 4; k++) {
    put(-half, Math.PI * k / 2);
    put(half, Math.PI * k / 2);
  }
  for (const turn of [0, Math.PI / 2]) for (const end of [-1, 1]) for (let k = 0; k < 8; k++)
    for (const n of [k, k + 1]) {
      const a = Math.PI * (n / 8 - 0.5), across = radius * Math.sin(a);
      out.push(end * (half + radius * Math.cos(a)), across * Math.cos(turn), across * Math.sin(turn));
    }
  return lines(out);
}
function boxLines([x, y, z]) {
  return new THREE.EdgesGeometry(new THREE.BoxBufferGeometry(2 * x, 2 * y, 2 * z));
}
function lines(position) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(position), 3));
  return geometry;
}

// ---- the run --------------------------------------------------------------------------------------------------------

export class Stage {
  constructor() {
    this.group = new THREE.Group();
    this.objects = new Map();
    this.hands = FOLDERS.map(() => null);
    this.show = {forces: true, contacts: false, polygons: false, measured: true};
    this.scale = SCALES_M_PER_N[0];
    this.palm = null; // where the hand is, or the middle of two: {p, q, apart}
    this.links = null;
    this.makeForces();
    this.makeContacts();
    this.polygons = new THREE.Group();
    this.group.add(this.polygons);
  }

  // -- what does not move --

  setLinks(links) {
    if (links === this.links) return;
    this.links = links;
    for (const {node} of this.objects.values()) this.group.remove(node);
    this.objects.clear();
    this.meshes = null;
    this.removeHands();
    let painted = 0;
    for (const link of links || []) {
      const geom = link.geom[0];
      if (!link.name.startsWith("objects::") || !geom || geom.type !== 4) continue;
      const fixed = Math.abs(geom.color[0] - geom.color[2]) < 0.08; // grey: what never moves
      this.addObject(link.name.slice(9), geom, fixed ? STATIC : PAINT[painted++ % PAINT.length], fixed);
    }
  }

  addObject(name, geom, paint, fixed) {
    const node = new THREE.Group(), inner = new THREE.Group();
    inner.position.copy(vector(geom.position));
    inner.quaternion.copy(quaternion(geom.quaternion));
    node.add(inner);
    this.group.add(node);
    const object = {node, inner, paint, fixed, polygon: new Map()};
    this.objects.set(name, object);
    this.dress(object, geom.float_data);
  }

  // The surface, its edges, and an outline (its back, a little larger).
  dress(object, numbers) {
    const {inner, paint, fixed} = object, geometry = meshGeometry(numbers);
    const mesh = new THREE.Mesh(geometry, new THREE.MeshStandardMaterial({color: color(paint), roughness: fixed ? 0.95 : 0.55, polygonOffset: true,
      polygonOffsetFactor: 1, polygonOffsetUnits: 1}));
    mesh.castShadow = !fixed;
    mesh.receiveShadow = true;
    const edges = new THREE.LineSegments(new THREE.EdgesGeometry(geometry, geometry.getAttribute("position").count > MANY ? 70 : 35),
      new THREE.LineBasicMaterial({color: color(fixed ? "#6d737c" : "#0d2230"), transparent: true, opacity: fixed ? 0.5 : 0.6}));
    inner.remove(...inner.children);
    inner.add(mesh, edges);
    if (!fixed) inner.add(new THREE.Mesh(geometry, OUTLINE));
    for (const polygon of object.polygon.values()) this.polygons.remove(polygon);
    object.polygon.clear();
    object.geometry = geometry;
  }

  // Meshes as the scene file has them, by the object's name and in its frame, in place of those that were thinned for a message.
  setMeshes(meshes) {
    if (!meshes || this.meshes === meshes) return;
    this.meshes = meshes;
    for (const [name, object] of this.objects) {
      if (!meshes[name]) continue;
      object.inner.position.set(0, 0, 0);
      object.inner.quaternion.set(0, 0, 0, 1);
      this.dress(object, meshes[name]);
    }
  }

  // -- the hand --

  get hand() { return this.hands[0]; }

  removeHands() {
    for (const hand of this.hands) if (hand) this.group.remove(hand.node);
    this.hands.fill(null);
  }

  makeHand(state, which) {
    const hand = measure(this.links, state, FOLDERS[which]), skin = makeSkin(hand), node = new THREE.Group();
    const bones = skin.bones.map(() => new THREE.Bone());
    const back = skin.bones.map(({p, q}) => new THREE.Matrix4().getInverse(
      new THREE.Matrix4().compose(vector(p), quaternion(q), new THREE.Vector3(1, 1, 1))));
    const geometry = geometryOf(skin.points.flat(), skin.normals.flat());
    geometry.setIndex(skin.faces.flat());
    geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(skin.colors.flat()), 3));
    geometry.setAttribute("skinIndex", new THREE.BufferAttribute(new Uint16Array(skin.weights.flatMap(w => w.bone)), 4));
    geometry.setAttribute("skinWeight", new THREE.BufferAttribute(new Float32Array(skin.weights.flatMap(w => w.weight)), 4));
    const mesh = new THREE.SkinnedMesh(geometry, new THREE.MeshStandardMaterial({color: color(SKIN), roughness: 0.62, skinning: true,
      vertexColors: THREE.VertexColors}));
    mesh.bindMode = "detached";
    mesh.bind(new THREE.Skeleton(bones, back), new THREE.Matrix4());
    mesh.frustumCulled = false;
    mesh.castShadow = mesh.receiveShadow = true;
    for (const bone of bones) {
      bone.matrixAutoUpdate = false;
      node.add(bone);
    }
    node.add(mesh);
    this.hands[which] = {node, bones, mesh, measured: this.makeMeasured(hand, node), band: this.makeBand(hand, node)};
    this.group.add(node);
  }

  // The receiver of the tracker on a band around the wrist.
  makeBand(hand, node) {
    const band = new THREE.Group(), dark = new THREE.MeshStandardMaterial({color: color("#3a3f47"), roughness: 0.8});
    const strap = new THREE.Mesh(new THREE.CylinderBufferGeometry(0.0212, 0.0216, 0.026, 48).rotateZ(Math.PI / 2), dark);
    const receiver = new THREE.Mesh(new THREE.BoxBufferGeometry(0.024, 0.022, 0.011), dark);
    strap.scale.set(1, 1.6, 1);
    strap.position.x = 0.008 - CUT;
    receiver.position.set(0.008 - CUT, 0, 0.026);
    for (const part of [strap, receiver]) part.castShadow = part.receiveShadow = true;
    band.add(strap, receiver);
    node.add(band);
    return band;
  }

  makeMeasured(hand, node) {
    return Array.from({length: PALM + 1}, (_, i) => {
      const geometry = i < PALM ? capsuleLines(hand.radius[i], hand.half[i]) : boxLines(hand.palm.half.map(x => x + hand.palm.radius));
      const line = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({color: color(GLOVE), transparent: true, depthTest: false}));
      line.renderOrder = 5;
      node.add(line);
      return line;
    });
  }

  // -- forces, contacts --

  makeForces() {
    const material = see => new THREE.MeshStandardMaterial({color: color(FORCE), roughness: 0.5, emissive: color(FORCE), emissiveIntensity: 0.25,
      transparent: true, opacity: see ? 0.3 : 1, depthTest: !see});
    const shaft = new THREE.CylinderBufferGeometry(0.0015, 0.0015, 1, 16).translate(0, 0.5, 0).rotateX(Math.PI / 2);
    const tip = new THREE.ConeBufferGeometry(0.0042, 0.011, 20).translate(0, 0.0055, 0).rotateX(Math.PI / 2);
    this.forces = Array.from({length: FOLDERS.length * (PALM + 1)}, () => {
      const node = new THREE.Group(), shafts = [], tips = [];
      for (const see of [true, false]) { // once through everything, faint, and once as it stands
        const m = material(see), a = new THREE.Mesh(shaft, m), b = new THREE.Mesh(tip, m);
        a.renderOrder = b.renderOrder = see ? 4 : 3;
        shafts.push(a);
        tips.push(b);
        node.add(a, b);
      }
      node.visible = false;
      this.group.add(node);
      return {node, shafts, tips};
    });
  }

  makeContacts() {
    const geometry = new THREE.SphereBufferGeometry(0.0018, 16, 12);
    this.contacts = Array.from({length: CONTACTS}, () => {
      const dot = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({color: color(CONTACT), depthTest: false, transparent: true}));
      dot.renderOrder = 6;
      dot.visible = false;
      this.group.add(dot);
      return dot;
    });
  }

  // The sum of each limb's contact forces, where they have their centre; limbs of the second hand behind those of the first.
  placeForces(state) {
    const sum = this.forces.map(() => ({f: new THREE.Vector3(), p: new THREE.Vector3(), weight: 0}));
    for (const contact of contactsOf(state)) {
      if (!(contact.limb >= 0 && contact.limb <= PALM)) continue;
      const s = sum[contact.hand * (PALM + 1) + contact.limb], f = vector(contact.force_n), weight = f.length();
      s.f.add(f);
      s.p.addScaledVector(vector(contact.position_m), weight);
      s.weight += weight;
    }
    this.forces.forEach((arrow, i) => {
      const {f, p, weight} = sum[i], length = Math.min(ARROW_M, f.length() * this.scale);
      arrow.node.visible = this.show.forces && length > 0.002;
      if (!arrow.node.visible) return;
      arrow.node.position.copy(p.multiplyScalar(1 / weight));
      arrow.node.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), f.normalize());
      const tip = Math.min(0.011, length * 0.6);
      for (const s of arrow.shafts) s.scale.set(1, 1, Math.max(1e-4, length - tip));
      for (const t of arrow.tips) {
        t.position.z = length - tip;
        t.scale.set(1, 1, tip / 0.011);
      }
    });
  }

  placeContacts(state) {
    const contacts = contactsOf(state);
    this.contacts.forEach((dot, i) => {
      const contact = contacts[i];
      dot.visible = this.show.contacts && Boolean(contact);
      if (!dot.visible) return;
      dot.position.copy(vector(contact.position_m));
      dot.material.color.copy(color(contact.depth_m > 0 ? CONTACT : "#f2a65a"));
      dot.scale.setScalar(1 + Math.min(1.2, Math.max(0, contact.depth_m) * 6000));
    });
  }

  // Polygons that a limb touches, as they lie on the object; the triangles of each are found once.
  placePolygons(state) {
    this.polygons.children.forEach(child => { child.visible = false; });
    if (!this.show.polygons) return;
    const seen = new Set();
    for (const polygon of [...state.polygon, ...(state.second?.polygon ?? [])].slice(0, POLYGONS)) {
      const name = state.object[polygon.object]?.name, object = this.objects.get(name), key = `${name} ${polygon.piece} ${polygon.face}`;
      if (!object || seen.has(key)) continue;
      seen.add(key);
      if (!object.polygon.has(key)) object.polygon.set(key, this.makePolygon(object, polygon));
      const mesh = object.polygon.get(key);
      object.inner.updateWorldMatrix(true, false);
      mesh.matrix.copy(object.node.matrix).multiply(object.inner.matrix);
      mesh.visible = true;
    }
  }

  makePolygon(object, polygon) {
    object.inner.updateWorldMatrix(true, false);
    const point = object.inner.worldToLocal(vector(polygon.position_m).applyMatrix4(this.group.matrixWorld));
    const mesh = new THREE.Mesh(polygonAt(object.geometry, point), new THREE.MeshBasicMaterial({color: color(POLYGON), transparent: true, opacity: 0.9,
      polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2}));
    mesh.matrixAutoUpdate = false;
    this.polygons.add(mesh);
    return mesh;
  }

  // -- a moment --

  // Between two states, `part` of the way from a to b.
  place(a, b, part) {
    for (let i = 0; i < a.object.length; i++) {
      const object = this.objects.get(a.object[i].name);
      if (!object) continue;
      pose(object.node, a.object[i], b.object[i] ?? a.object[i], part, "");
      object.node.updateMatrix();
    }
    this.showHand(0, a, b, part);
    this.showHand(1, a.second, b.second ?? a.second, part);
    this.aim();
    const near = part < 0.5 ? a : b;
    this.placeForces(near);
    this.placeContacts(near);
    this.placePolygons(near);
  }

  aim() {
    const [first, second] = this.hands.map(hand => (hand?.node.visible ? hand.palm : null));
    if (!first && !second) return;
    const both = first && second, {p, q} = first ?? second;
    this.palm = {p: both ? p.clone().lerp(second.p, 0.5) : p, q, apart: both ? p.distanceTo(second.p) : 0};
  }

  showHand(which, a, b, part) {
    const seen = Boolean(a && a.glove_age_s >= 0), drawable = this.links?.some(link => link.name.startsWith(FOLDERS[which]));
    if (seen && !this.hands[which] && drawable) this.makeHand(a, which);
    const hand = this.hands[which];
    if (!hand) return;
    hand.node.visible = seen;
    if (seen) this.placeHand(hand, a, b, part);
  }

  placeHand(hand, a, b, part) {
    const at = new THREE.Object3D(), {bones, measured, band} = hand;
    for (let i = 0; i <= PALM; i++) {
      pose(at, a.limb[i], b.limb[i], part, "");
      at.updateMatrix();
      bones[i].matrix.copy(at.matrix);
      this.placeMeasured(measured[i], at, a.limb[i], b.limb[i], part);
    }
    hand.palm = {p: at.position.clone(), q: at.quaternion.clone()};
    // The forearm follows the wrist as measured, moved as the palm is moved from where it was measured.
    const palm = a.limb[PALM], turned = multiply(palm.quaternion, inverse(palm.driver_quaternion));
    const off = rotate(turned, [0, 1, 2].map(k => a.wrist_position_m[k] - palm.driver_position_m[k]));
    at.position.add(vector(off));
    at.quaternion.copy(quaternion(multiply(turned, a.wrist_quaternion)));
    at.updateMatrix();
    bones[FOREARM].matrix.copy(at.matrix);
    band.position.copy(at.position);
    band.quaternion.copy(at.quaternion);
    for (const bone of bones) bone.matrixWorldNeedsUpdate = true;
    console.assert(bones.length === BONES);
  }

  placeMeasured(line, simulated, a, b, part) {
    const driver = new THREE.Object3D();
    pose(driver, a, b, part, "driver_");
    const off = driver.position.distanceTo(simulated.position), turned = 2 * Math.acos(Math.min(1, Math.abs(driver.quaternion.dot(simulated.quaternion))));
    const much = Math.max(off / DIFFERS_M, turned / DIFFERS_RAD);
    line.visible = this.show.measured && much > 1;
    line.material.opacity = Math.min(0.75, 0.2 * (much - 1));
    line.position.copy(driver.position);
    line.quaternion.copy(driver.quaternion);
  }
}

// Those of both hands, each with its hand; objects against objects stand in both states.
function contactsOf(state) {
  const second = (state.second?.contact ?? []).filter(contact => contact.limb >= 0);
  return [...state.contact.map(contact => ({...contact, hand: 0})), ...second.map(contact => ({...contact, hand: 1}))];
}

function pose(node, a, b, part, prefix) {
  const p = prefix + "position_m", q = prefix + "quaternion";
  node.position.copy(vector(a[p]));
  node.quaternion.copy(quaternion(a[q]));
  if (part <= 0 || a === b) return;
  node.position.lerp(vector(b[p]), part);
  node.quaternion.slerp(quaternion(b[q]), part);
}
