// SPDX-License-Identifier: BSD-3-Clause
// What stands around a run: light with a soft shadow that follows the hand, and a grid with a scale on the table.
import * as THREE from "/three.js";
import {Stage, color} from "./stage.js";

const GRID_M = 0.4, FINE_M = 0.01, COARSE_M = 0.05, SHADOW_M = 0.24;

export function makeRenderer(canvas) {
  const renderer = new THREE.WebGLRenderer({canvas, antialias: true, alpha: true, preserveDrawingBuffer: true});
  renderer.gammaOutput = true;
  renderer.gammaFactor = 2.2;
  renderer.toneMapping = THREE.ACESFilmicToneMapping;
  renderer.toneMappingExposure = 0.95;
  renderer.shadowMap.enabled = true;
  renderer.shadowMap.type = THREE.PCFShadowMap;
  renderer.setClearColor(0, 0);
  renderer.autoClear = false;
  return renderer;
}

// Lines of a square grid, every FINE_M and stronger every COARSE_M; each fades towards the border.
function makeGrid() {
  const position = [], shade = [];
  const add = (a, b, strength) => {
    const parts = 16;
    for (let k = 0; k < parts; k++) for (const t of [k / parts, (k + 1) / parts]) {
      const p = [a[0] + (b[0] - a[0]) * t, a[1] + (b[1] - a[1]) * t, 0.0004], far = Math.hypot(p[0], p[1]) / GRID_M;
      position.push(...p);
      shade.push(0.16, 0.19, 0.24, strength * Math.max(0, 1 - far * far));
    }
  };
  const count = Math.round(GRID_M / FINE_M), every = Math.round(COARSE_M / FINE_M);
  for (let i = -count; i <= count; i++) {
    const x = i * FINE_M, strength = i % every ? 0.1 : 0.42;
    add([x, -GRID_M], [x, GRID_M], strength);
    add([-GRID_M, x], [GRID_M, x], strength);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(position), 3));
  geometry.setAttribute("shade", new THREE.BufferAttribute(new Float32Array(shade), 4));
  return new THREE.LineSegments(geometry, new THREE.ShaderMaterial({transparent: true, depthWrite: false,
    vertexShader: "attribute vec4 shade; varying vec4 c; void main() { c = shade; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
    fragmentShader: "varying vec4 c; void main() { gl_FragColor = c; }"}));
}

// A word that lies flat on the table, along x or (1) along y.
function makeLabel(text, x, y, along) {
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  canvas.width = 256;
  canvas.height = 64;
  pen.font = "600 40px system-ui, sans-serif";
  pen.fillStyle = "#3b4350";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText(text, 128, 34);
  const mesh = new THREE.Mesh(new THREE.PlaneBufferGeometry(0.048, 0.012),
    new THREE.MeshBasicMaterial({map: new THREE.CanvasTexture(canvas), transparent: true, depthWrite: false}));
  mesh.position.set(x, y, 0.0006);
  mesh.userData.along = along;
  return mesh;
}

export class Room {
  constructor() {
    this.scene = new THREE.Scene();
    this.stage = new Stage();
    this.scene.add(this.stage.group);
    this.grid = new THREE.Group();
    this.grid.add(makeGrid());
    this.labels = [];
    for (const cm of [-15, -10, -5, 0, 5, 10, 15])
      for (const side of [-1, 1]) this.labels.push(makeLabel(`${cm} cm`, cm / 100, side * 0.19, 0), makeLabel(`${cm} cm`, side * 0.19, cm / 100, 1));
    this.grid.add(...this.labels);
    this.scene.add(this.grid);
    this.makeLight();
  }

  makeLight() {
    this.scene.add(new THREE.HemisphereLight(color("#eaf1fb"), color("#8a7a70"), 0.72));
    this.sun = new THREE.DirectionalLight(color("#fff1de"), 2.0);
    const shadow = this.sun.shadow, view = shadow.camera;
    shadow.mapSize.set(1024, 1024);
    shadow.radius = 4;
    shadow.bias = -0.0006;
    view.left = view.bottom = -SHADOW_M;
    view.right = view.top = SHADOW_M;
    view.near = 0.1;
    view.far = 1.6;
    this.sun.castShadow = true;
    const rim = new THREE.DirectionalLight(color("#cfe0ff"), 0.6);
    rim.position.set(-0.6, 0.2, 0.4);
    this.scene.add(this.sun, this.sun.target, rim);
  }

  // Light from over the shoulder of the one who looks.
  light(target, turn) {
    const a = turn - 0.75;
    for (const label of this.labels) { // upright for the one who looks
      const quarter = label.userData.along, from = quarter ? Math.cos(turn) : Math.sin(turn);
      label.rotation.z = (quarter ? -Math.PI / 2 : 0) + (from < 0 ? 0 : Math.PI);
    }
    this.sun.target.position.copy(target);
    this.sun.position.set(0.42 * Math.cos(a), 0.42 * Math.sin(a), 0.72).add(target);
  }
}
