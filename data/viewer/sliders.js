// SPDX-License-Identifier: BSD-3-Clause
// Sliders that move the hand of `gloved --fcu hand:`: wrist, turn and grip, sent twenty times a second while the switch is held.
// They are there only while such a gloved runs. Simulated forces are shown; none leaves a gloved that has this hand.
import {multiply} from "./skin.js";

const SEND_MS = 50, STEP_M = 0.01; // a slider may jump; the wrist then goes there at 0.2 m/s, so that what it holds can follow
const DEG = Math.PI / 180;
const about = (axis, deg) => [Math.cos(deg * DEG / 2), ...[0, 1, 2].map(k => (k === axis ? Math.sin(deg * DEG / 2) : 0))];
const MOVES = [["x", "forward", -0.4, 0.4], ["y", "left", -0.4, 0.4], ["z", "up", 0, 0.5]];
const TURNS = [["roll", "roll", -180, 180], ["pitch", "pitch", -90, 90], ["yaw", "yaw", -180, 180]];
const FINGERS = ["thumb", "index", "middle", "ring", "little"];

// A quaternion w x y z as turns about the world's x, then y, then z, in degrees; and back.
export function turnsOf([w, x, y, z]) {
  return [Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), Math.asin(Math.max(-1, Math.min(1, 2 * (w * y - z * x)))),
    Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))].map(a => a / DEG);
}
export const quaternionOf = ([roll, pitch, yaw]) => multiply(about(2, yaw), multiply(about(1, pitch), about(0, roll)));

export class Sliders {
  constructor(box) {
    this.box = box;
    this.input = {};
    this.timer = null;
    const rows = [...MOVES, ...TURNS].map(([name, label, low, high]) => this.slider(name, label, low, high));
    this.grip = this.slider("grip", "grip, all", 0, 1);
    box.append(...rows, this.grip, ...FINGERS.map(name => this.slider(name, name, 0, 1)), this.buttons());
    this.input.grip.addEventListener("input", () => { for (const name of FINGERS) this.input[name].value = this.input.grip.value; });
  }

  slider(name, text, low, high) {
    const row = document.createElement("label"), word = document.createElement("span"), input = document.createElement("input");
    word.textContent = text;
    Object.assign(input, {type: "range", min: low, max: high, step: "any", value: 0});
    row.append(word, input);
    this.input[name] = input;
    return row;
  }

  buttons() {
    const row = document.createElement("div"), hold = document.createElement("button"), home = document.createElement("button");
    this.hold = hold;
    this.told = document.createElement("span");
    home.textContent = "Home";
    hold.onclick = () => this.take(!this.held);
    home.onclick = () => this.goHome();
    row.className = "buttons";
    row.append(hold, home, this.told);
    this.take(false);
    return row;
  }

  // The dead-man switch of this hand.
  take(held) {
    this.held = held;
    this.hold.textContent = held ? "Let go" : "Take the hand";
    this.hold.classList.toggle("on", held);
  }

  // With `present` the panel appears and begins to send.
  set(present) {
    if (present === Boolean(this.timer)) return;
    this.box.hidden = !present;
    clearInterval(this.timer);
    this.timer = present ? setInterval(() => this.send(), SEND_MS) : null;
    this.take(false);
    if (present) this.ask();
  }

  wanted() {
    const value = name => Number(this.input[name].value);
    this.at = MOVES.map(([name], k) => {
      const way = value(name) - (this.at?.[k] ?? value(name));
      return value(name) - way + Math.max(-STEP_M, Math.min(STEP_M, way));
    });
    return {position: this.at, quaternion: quaternionOf(TURNS.map(([name]) => value(name))), grips: FINGERS.map(value)};
  }

  async post(message) {
    if (this.waiting) return null;
    this.waiting = true;
    if (this.home) {
      message = {home: true};
      this.home = false;
    }
    try {
      const answer = await fetch("/hand", {method: "POST", headers: {"Content-Type": "application/json"}, body: JSON.stringify(message)});
      return await answer.json();
    } catch {
      return null;
    } finally {
      this.waiting = false;
    }
  }

  // While the hand is not taken the sliders show where it is.
  async send() {
    const now = await this.post(this.held ? {...this.wanted(), dead_man: true} : {ask: true});
    this.told.textContent = !now?.position ? "no answer" : now.other ? "somebody else moves it" : "";
    if (now?.position && !this.held) this.put(now);
  }
  async ask() {
    const now = await this.post({ask: true});
    if (now?.position) this.put(now);
  }
  goHome() { // with the next message
    this.take(false);
    this.home = true;
  }

  put({position, quaternion, grips}) {
    this.at = position;
    MOVES.forEach(([name], k) => { this.input[name].value = position[k]; });
    turnsOf(quaternion).forEach((turn, k) => { this.input[TURNS[k][0]].value = turn; });
    FINGERS.forEach((name, k) => { this.input[name].value = grips[k]; });
    this.input.grip.value = grips.reduce((a, b) => a + b, 0) / grips.length;
  }
}
