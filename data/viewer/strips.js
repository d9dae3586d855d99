// SPDX-License-Identifier: BSD-3-Clause
// Strips of force against time, one for each finger: filled what was commanded, thin what the device measured; a second
// run as a dashed line. All five have one scale.
import {FINGERS} from "./run.js";

const COLORS = ["#0072b2", "#d55e00", "#009e73", "#b5589a", "#b07d00"], INK = "#28303b";
const ROUND_N = [0.5, 1, 2, 3, 5, 8, 12, 20, 30];

export class Strips {
  constructor(canvas) {
    this.canvas = canvas;
    this.pen = canvas.getContext("2d");
  }

  // `runs`: one or two; from..to: seconds shown; now: where the moment is.
  draw(runs, from, to, now) {
    const ratio = window.devicePixelRatio || 1, width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (this.canvas.width !== Math.round(width * ratio) || this.canvas.height !== Math.round(height * ratio)) {
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(height * ratio);
    }
    this.pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.pen.clearRect(0, 0, width, height);
    const top = this.top(runs, from, to), each = (height - 20) / FINGERS.length;
    FINGERS.forEach((name, i) => this.strip(runs, i, {from, to, now, top, x: 8, width: width - 16, y: i * each, height: each - 8}));
    this.axis(from, to, 8, width - 16, height);
  }

  top(runs, from, to) {
    let most = 0;
    for (const {curves} of runs) curves.t.forEach((t, k) => {
      if (t >= from && t <= to) for (const list of curves.commanded) most = Math.max(most, list[k]);
    });
    return ROUND_N.find(n => n >= most * 1.05) ?? most;
  }

  strip(runs, i, box) {
    const {pen} = this, at = t => box.x + (t - box.from) / (box.to - box.from) * box.width;
    const base = box.y + box.height, up = n => base - Math.min(1, Math.max(0, n / box.top)) * (box.height - 18);
    pen.fillStyle = "#f6f7f9";
    pen.fillRect(box.x, box.y + 18, box.width, box.height - 18);
    runs.forEach(({curves}, number) => {
      const points = pick(curves, curves.commanded[i], box.from, box.to, box.width).map(([t, n]) => [at(t), up(n)]);
      if (!points.length) return;
      if (number === 0) this.fill(points, base, COLORS[i]);
      this.line(points, COLORS[i], 1.5, number ? [4, 3] : []);
      if (runs.length === 1) this.line(pick(curves, curves.measured[i], box.from, box.to, box.width).map(([t, n]) => [at(t), up(n)]), INK, 0.7, []);
    });
    this.line([[at(box.now), box.y + 18], [at(box.now), base]], INK, 1, []);
    this.line([[box.x, base], [box.x + box.width, base]], "#9aa2ad", 1, []);
    this.words(runs, i, box);
  }

  words(runs, i, box) {
    const {pen} = this, shown = runs.map(({curves}) => valueAt(curves, curves.commanded[i], box.now));
    pen.font = "600 12px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.fillStyle = COLORS[i];
    pen.fillText(FINGERS[i], box.x, box.y + 13);
    pen.textAlign = "right";
    pen.fillStyle = INK;
    pen.fillText(shown.map(n => `${n.toFixed(2)} N`).join("  |  "), box.x + box.width, box.y + 13);
    pen.font = "10px system-ui, sans-serif";
    pen.fillStyle = "#7b8490";
    pen.fillText(`${box.top} N`, box.x + box.width - 2, box.y + 28);
  }

  fill(points, base, color) {
    const {pen} = this;
    pen.beginPath();
    pen.moveTo(points[0][0], base);
    for (const [x, y] of points) pen.lineTo(x, y);
    pen.lineTo(points[points.length - 1][0], base);
    pen.globalAlpha = 0.22;
    pen.fillStyle = color;
    pen.fill();
    pen.globalAlpha = 1;
  }

  line(points, color, width, dash) {
    const {pen} = this;
    pen.beginPath();
    points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.setLineDash(dash);
    pen.strokeStyle = color;
    pen.lineWidth = width;
    pen.stroke();
    pen.setLineDash([]);
  }

  axis(from, to, x, width, height) {
    const {pen} = this, span = to - from, step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60, 120, 300].find(s => span / s <= 6) ?? 600;
    pen.font = "10px system-ui, sans-serif";
    pen.fillStyle = "#59616d";
    pen.textAlign = "center";
    for (let t = Math.ceil(from / step) * step; t <= to; t += step) {
      const at = x + (t - from) / span * width;
      if (at > x + 8 && at < x + width - 14) pen.fillText(`${+t.toFixed(1)} s`, at, height - 6);
    }
  }
}

// The curve from..to as [t, value], no more than two points a pixel; of those left out the largest stays.
function pick({t}, list, from, to, width) {
  const inside = [];
  for (let k = 0; k < t.length; k++) if (t[k] >= from && t[k] <= to) inside.push(k);
  const stride = Math.max(1, Math.floor(inside.length / (2 * width))), out = [];
  for (let k = 0; k < inside.length; k += stride) {
    let best = inside[k];
    for (const m of inside.slice(k, k + stride)) if (list[m] > list[best]) best = m;
    out.push([t[best], list[best]]);
  }
  return out;
}

function valueAt({t}, list, now) {
  let low = 0, high = t.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (t[middle] <= now) low = middle;
    else high = middle - 1;
  }
  return list[low] ?? 0;
}
