// SPDX-License-Identifier: BSD-3-Clause
// The camera: around a point that follows the hand, from the palm's side, the side, above, or as the head's tracker
// sees it. Drag turns, right drag or shift moves, wheel zooms, arrow keys turn.
import * as THREE from "/three.js";

const FIELD_DEG = 32, FOLLOW_S = 0.25, TURN_PER_PX = 0.006, UP = new THREE.Vector3(0, 0, 1);
// Direction to the eye in the hand's own terms: out of the palm, along the fingers, up in the world; and the distance.
const PRESETS = {
  palm: {palmar: 0.72, fingers: 0.55, up: 0.42, distance: 0.46},
  side: {palmar: -0.1, fingers: 1, up: 0.25, distance: 0.46},
  top: {palmar: 0.12, fingers: -0.02, up: 1, distance: 0.52},
  back: {palmar: -0.8, fingers: 0.25, up: 0.45, distance: 0.5},
};

export class Camera {
  constructor(canvas) {
    this.eye = new THREE.PerspectiveCamera(FIELD_DEG, 1, 0.01, 20);
    this.eye.up.copy(UP);
    this.target = new THREE.Vector3(0, 0, 0.1);
    this.shift = new THREE.Vector3(); // of the target from the hand, by the user
    this.turn = -1;
    this.lift = 0.5;
    this.distance = 0.5;
    this.preset = "palm";
    this.aimed = false; // true once a preset has met a hand
    this.listen(canvas);
  }

  choose(preset) {
    this.preset = preset;
    this.aimed = false;
    this.shift.set(0, 0, 0);
  }

  // `palm`: {p, q, apart} or null: of two hands the middle, and how far they are apart; `head`: the same, only where there is a tracker on it.
  follow(palm, head, passed_s) {
    if (this.preset === "head" && head) return this.lookAsHead(head);
    if (!palm) return this.place();
    const fingers = new THREE.Vector3(1, 0, 0).applyQuaternion(palm.q), palmar = new THREE.Vector3(0, 0, -1).applyQuaternion(palm.q);
    const wanted = palm.p.clone().addScaledVector(fingers, 0.03).addScaledVector(palmar, 0.03).add(this.shift);
    if (!this.aimed) {
      this.aim(fingers, palmar, palm.apart);
      this.target.copy(wanted);
      this.aimed = true;
    }
    this.target.lerp(wanted, 1 - Math.exp(-passed_s / FOLLOW_S));
    this.place();
  }

  aim(fingers, palmar, apart_m) {
    const preset = PRESETS[this.preset] || PRESETS.palm, flat = v => v.clone().setZ(v.z * 0.3);
    const to = flat(palmar).multiplyScalar(preset.palmar).addScaledVector(flat(fingers), preset.fingers).addScaledVector(UP, preset.up).normalize();
    this.turn = Math.atan2(to.y, to.x);
    this.lift = Math.asin(Math.max(-1, Math.min(1, to.z)));
    this.distance = preset.distance + apart_m;
  }

  place() {
    const flat = Math.cos(this.lift), away = this.distance * Math.max(1, 1 / this.eye.aspect); // a narrow window shows as much
    this.eye.position.set(flat * Math.cos(this.turn), flat * Math.sin(this.turn), Math.sin(this.lift)).multiplyScalar(away).add(this.target);
    this.eye.up.copy(UP);
    this.eye.lookAt(this.target);
  }

  // The head's receiver looks along its x, z up.
  lookAsHead(head) {
    const ahead = new THREE.Vector3(1, 0, 0).applyQuaternion(head.q);
    this.eye.position.copy(head.p);
    this.eye.up.set(0, 0, 1).applyQuaternion(head.q);
    this.eye.lookAt(head.p.clone().add(ahead));
    this.target.copy(head.p).addScaledVector(ahead, 0.5);
  }

  // Metres that a pixel is wide where the camera looks.
  metresPerPixel(height) {
    const away = this.eye.position.distanceTo(this.target);
    return 2 * away * Math.tan(FIELD_DEG * Math.PI / 360) / height;
  }

  turnBy(dx, dy) {
    this.turn -= dx * TURN_PER_PX;
    this.lift = Math.max(-1.5, Math.min(1.5, this.lift + dy * TURN_PER_PX));
  }

  moveBy(dx, dy, height) {
    const s = this.metresPerPixel(height), m = this.eye.matrixWorld.elements;
    const by = new THREE.Vector3(m[0], m[1], m[2]).multiplyScalar(-dx * s).addScaledVector(new THREE.Vector3(m[4], m[5], m[6]), dy * s);
    this.shift.add(by);
    this.target.add(by);
  }

  zoomBy(factor) { this.distance = Math.max(0.08, Math.min(4, this.distance * factor)); }

  listen(canvas) {
    let last = null;
    canvas.addEventListener("contextmenu", event => event.preventDefault());
    canvas.addEventListener("pointerdown", event => {
      last = {x: event.clientX, y: event.clientY, move: event.button !== 0 || event.shiftKey};
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointerup", () => { last = null; });
    canvas.addEventListener("pointermove", event => {
      if (!last) return;
      const dx = event.clientX - last.x, dy = event.clientY - last.y;
      last.x = event.clientX;
      last.y = event.clientY;
      if (this.preset === "head") this.choose("palm");
      if (last.move) this.moveBy(dx, dy, canvas.clientHeight);
      else this.turnBy(dx, dy);
    });
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      this.zoomBy(Math.exp(event.deltaY / 1000));
    }, {passive: false});
  }
}
