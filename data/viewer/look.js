// SPDX-License-Identifier: BSD-3-Clause
// The page of gloved-look: takes states from the server as they happen, or plays one or two LCM logs, and draws them.
// Drawn anew only when something has changed. `?log=0&time=6&camera=side&show=contacts,grid` in the address: logs of the
// server's command line, paused at a time, what is seen. `window.gloved` tells what is shown (tests ask it).
import {Camera} from "./camera.js";
import {makeRenderer, Room} from "./room.js";
import {LiveRun, LogRun, SAFETY} from "./run.js";
import {forceScale} from "./stage.js";
import {Sliders} from "./sliders.js";
import {Strips} from "./strips.js";

const SILENT_MS = 1000, STATE_S = 0.02, STRIP_S = 10;
const SCALES_M = [0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5];
const by = id => document.getElementById(id), asked = new URLSearchParams(location.search);

const canvas = by("view"), renderer = makeRenderer(canvas), camera = new Camera(canvas), strips = new Strips(by("strips"));
const sliders = new Sliders(by("sliders"));
const live = new LiveRun(), rooms = [new Room()];
let layouts = null, logs = [], time = 0, playing = true, followed = true, connected = true, dirty = true, drawn = 0;
const show = {forces: true, contacts: false, polygons: false, measured: true, grid: true};

const runs = () => (logs.length ? logs : [live]);
const begin = () => Math.min(...runs().map(run => run.begin)), end = () => Math.max(...runs().map(run => run.end));
const scale = () => forceScale(Math.max(...runs().map(run => run.strongest_n)));
const isLive = () => !logs.length, speed = () => Number(by("speed").value);
const touch = () => { dirty = true; };

// ---- what arrives ---------------------------------------------------------------------------------------------------

function listen() {
  const source = new EventSource("/events"), on = (kind, take) => source.addEventListener(kind, event => { take(JSON.parse(event.data)); touch(); });
  on("about", about => { live.about = about; });
  on("load", links => { live.load = links; });
  on("state", state => {
    if (live.add(state, performance.now())) followed ||= isLive();
  });
  source.onopen = () => { connected = true; touch(); };
  source.onerror = () => { connected = false; touch(); };
}

function alarm() {
  if (!isLive()) return "";
  if (!connected) return "gloved-look has ended: what you see is old. Start it again.";
  const silent = performance.now() - live.arrived;
  if (live.empty || silent < SILENT_MS) return "";
  return `Nothing arrives from gloved for ${silent < 1e4 ? (silent / 1e3).toFixed(1) : Math.round(silent / 1e3)} s: it has ended or hangs. What you see is old.`;
}

// ---- logs -----------------------------------------------------------------------------------------------------------

async function openLogs(files) {
  try {
    const opened = [];
    for (const {name, buffer} of files.slice(0, 2)) opened.push(new LogRun(name, await buffer(), layouts));
    logs = opened;
    playing = true;
    time = begin();
    setRooms();
    camera.aimed = false;
    by("speed").value = "1";
  } catch (error) {
    failed(error.message);
  }
  touch();
}
const fromFiles = list => openLogs([...list].map(file => ({name: file.name, buffer: () => file.arrayBuffer()})));
async function fromServer(list) {
  const names = await (await fetch("/logs")).json(), wanted = list.filter(i => names[i] !== undefined);
  if (wanted.length) await openLogs(wanted.map(i => ({name: names[i], buffer: async () => (await fetch(`/log/${i}`)).arrayBuffer()})));
}

let failure = "";
function failed(text) {
  failure = text;
  setTimeout(() => { failure = ""; touch(); }, 8000);
}

function goLive() {
  logs = [];
  followed = playing = true;
  by("speed").value = "1";
  setRooms();
  touch();
}

function setRooms() {
  while (rooms.length < runs().length) rooms.push(new Room());
  rooms.length = runs().length;
}

// ---- time -----------------------------------------------------------------------------------------------------------

function advance(passed_s) {
  if (isLive() && followed) {
    time = live.end;
    return;
  }
  if (!playing) return;
  const next = Math.min(end(), time + passed_s * speed());
  if (next !== time) touch();
  time = next;
  if (!isLive() && time >= end()) playing = false;
}

function go(to) {
  time = Math.max(begin(), Math.min(end(), to));
  followed = false;
  touch();
}
function step(by_s) {
  playing = false;
  go(time + by_s);
}
function pause() {
  if (isLive() && followed) {
    followed = playing = false;
  } else {
    playing = !playing;
    if (playing && time >= end()) isLive() ? goLive() : go(begin());
  }
  touch();
}

// ---- drawing --------------------------------------------------------------------------------------------------------

function headOf(state) {
  const p = state.head_position_m, q = state.head_quaternion;
  return p.some(x => x !== 0) || Math.abs(q[0]) < 0.9999999 ? {p: rooms[0].sun.position.clone().fromArray(p), q: rooms[0].sun.quaternion.clone().set(q[1], q[2], q[3], q[0])} : null;
}

// Meshes of a run's scene file, where the server finds it; null until they are here.
const meshes = new Map();
function meshesOf(about) {
  const hash = about?.scene_hash;
  if (!hash) return null;
  if (!meshes.has(hash)) {
    meshes.set(hash, null);
    fetch(`/meshes?${new URLSearchParams({file: about.scene, hash})}`).then(answer => answer.json()).then(found => {
      meshes.set(hash, found);
      touch();
    }).catch(() => {});
  }
  return meshes.get(hash);
}

function place(run, room) {
  if (run.empty) return null;
  const {a, b, part} = run.around(time);
  Object.assign(room.stage.show, show);
  room.grid.visible = show.grid;
  room.stage.setLinks(isLive() ? run.load : run.loadAt(time));
  room.stage.scale = scale();
  room.stage.setMeshes(meshesOf(run.about));
  room.stage.place(a, b, isLive() ? 0 : part);
  return part < 0.5 ? a : b;
}

// Without a graphics card a picture in full takes a tenth of a second: what moves is drawn coarser then, with every third shadow,
// and in full when it stands.
const COARSER = [1, 0.75, 0.55], SLOW_MS = 60, STILL_MS = 350;
let coarse = 0, slow = 0, lastDrawn = 0;
function reckon(now, passed_ms) {
  slow = passed_ms > SLOW_MS ? slow + 1 : 0;
  if (slow > 8 && coarse + 1 < COARSER.length) {
    coarse++;
    slow = 0;
  }
  lastDrawn = now;
}

function render(detail) {
  const width = canvas.clientWidth, height = canvas.clientHeight, ratio = (window.devicePixelRatio || 1) * detail, each = width / rooms.length;
  const size = renderer.getSize(rooms[0].sun.position.clone());
  if (size.x !== width || size.y !== height || renderer.getPixelRatio() !== ratio) {
    renderer.setPixelRatio(ratio);
    renderer.setSize(width, height, false);
  }
  camera.eye.aspect = each / height;
  camera.eye.updateProjectionMatrix();
  renderer.setScissorTest(true);
  rooms.forEach((room, i) => {
    room.light(camera.target, camera.turn);
    renderer.setViewport(i * each, 0, each, height);
    renderer.setScissor(i * each, 0, each, height);
    renderer.clear();
    renderer.shadowMap.autoUpdate = detail === 1;
    renderer.shadowMap.needsUpdate = drawn % 3 === 0;
    renderer.render(room.scene, camera.eye);
  });
}

function tell(states) {
  const state = states[0], run = runs()[0], warning = failure || alarm();
  by("banner").hidden = !warning;
  by("banner").textContent = warning;
  sliders.set(isLive() && connected && Boolean(live.about?.fcu.startsWith("hand:")));
  by("waiting").hidden = Boolean(state);
  by("play").textContent = playing ? "❚❚" : "▶";
  by("live").classList.toggle("on", isLive() && followed && connected);
  by("names").replaceChildren(...(logs.length > 1 ? logs.map((log, i) => span(`${"AB"[i]}: ${log.name}`)) : []));
  const second = runs().length === 1 && run.second_curves.t.length > 0;
  by("key").textContent = logs.length > 1 ? "newtons; A filled, B dashed" : second ? "newtons, as commanded; dashed: the second hand"
    : "newtons; filled: commanded, thin: measured by the device";
  tellScale();
  if (!state) return;
  const word = warning && isLive() ? "silent" : SAFETY[state.safety_state] ?? "?";
  by("state").textContent = word;
  by("state").className = `chip ${warning && isLive() ? "fault" : word}`;
  const scene = run.about?.scene?.split("/").pop(), damaged = logs.reduce((sum, log) => sum + log.damaged, 0);
  by("what").textContent = [logs.length ? logs.map(log => log.name).join(" and ") : "", scene, `${state.contact.length + (state.second?.contact.filter(c => c.limb >= 0).length ?? 0)} contacts`,
    state.second ? `second hand ${SAFETY[state.second.safety_state] ?? "?"}` : "",
    damaged ? `${damaged} damaged messages left out` : ""].filter(Boolean).join(" · ");
  by("clock").textContent = `${time.toFixed(2)} of ${end().toFixed(2)} s`;
  const scrub = by("scrub");
  scrub.min = begin();
  scrub.max = Math.max(end(), begin() + 0.1);
  scrub.value = time;
  const span_s = isLive() ? STRIP_S : Math.max(1, end() - begin()), from = isLive() ? Math.max(begin(), time - span_s) : begin();
  strips.draw(second ? [run, {curves: run.second_curves}] : runs(), from, from + span_s, time);
}
function span(text) {
  const node = document.createElement("span");
  node.textContent = text;
  return node;
}
function tellScale() {
  const pixel = camera.metresPerPixel(canvas.clientHeight), length = SCALES_M.find(m => m / pixel > 60) ?? 0.5;
  by("bar").style.width = `${Math.round(length / pixel)}px`;
  by("bar-text").textContent = `${+(length * 1e3).toFixed(1)} mm` + (show.forces ? `, an arrow of ${+(length / scale()).toFixed(2)} N` : "");
  by("legend-contacts").hidden = !show.contacts;
  by("legend-polygons").hidden = !show.polygons;
}

let last = performance.now(), lastAlarm = 0, drawnCoarse = false;
function frame(now) {
  requestAnimationFrame(frame);
  const passed = Math.min(0.1, (now - last) / 1e3), eye = camera.eye.matrixWorld.elements.slice();
  last = now;
  advance(passed);
  const palm = rooms[0].stage.palm, head = runs()[0].empty ? null : headOf(runs()[0].around(time).a);
  by("presets").querySelector("[data-preset=head]").disabled = !head;
  camera.follow(palm, head, passed);
  camera.eye.updateMatrixWorld();
  if (camera.eye.matrixWorld.elements.some((x, i) => Math.abs(x - eye[i]) > 2e-5)) touch();
  if (now - lastAlarm > 200 && (alarm() || !by("banner").hidden)) {
    lastAlarm = now;
    touch();
  }
  const still = !dirty && coarse && drawnCoarse && now - lastDrawn > STILL_MS;
  if (!dirty && !still) return;
  if (dirty) reckon(now, now - last + passed * 1e3);
  dirty = false;
  drawnCoarse = coarse > 0 && !still;
  const states = runs().map((run, i) => place(run, rooms[i]));
  if (!camera.aimed && rooms[0].stage.palm) touch();
  render(drawnCoarse ? COARSER[coarse] : 1);
  tell(states);
  drawn++;
}

// ---- what the user does ---------------------------------------------------------------------------------------------

function choose(preset) {
  camera.choose(preset);
  for (const button of by("presets").children) button.classList.toggle("on", button.dataset.preset === preset);
  touch();
}
function toggle(name, to = !show[name]) {
  show[name] = to;
  for (const button of by("switches").children) button.classList.toggle("on", show[button.dataset.show]);
  touch();
}
function help() {
  if (by("help").open) by("help").close();
  else by("help").showModal();
}
function changeSpeed(by_steps) {
  const select = by("speed");
  select.selectedIndex = Math.max(0, Math.min(select.options.length - 1, select.selectedIndex + by_steps));
}

const KEYS = {
  1: () => choose("palm"), 2: () => choose("side"), 3: () => choose("top"), 4: () => choose("back"), 5: () => choose("head"),
  f: () => toggle("forces"), c: () => toggle("contacts"), p: () => toggle("polygons"), m: () => toggle("measured"), g: () => toggle("grid"),
  " ": pause, l: goLive, h: help, "?": help, ",": () => changeSpeed(-1), ".": () => changeSpeed(1),
};

function onKey(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
  const arrow = {ArrowLeft: -1, ArrowRight: 1}[event.key], act = KEYS[event.key.toLowerCase()];
  if (!arrow && !act) return;
  event.preventDefault();
  if (arrow) step(arrow * (event.shiftKey ? 1 : STATE_S));
  else act();
}

function wire() {
  for (const button of by("presets").children) button.onclick = () => choose(button.dataset.preset);
  for (const button of by("switches").children) button.onclick = () => toggle(button.dataset.show);
  by("help-button").onclick = help;
  by("play").onclick = pause;
  by("live").onclick = goLive;
  by("scrub").oninput = () => go(Number(by("scrub").value));
  by("files").onchange = () => fromFiles(by("files").files);
  addEventListener("keydown", onKey);
  addEventListener("resize", touch);
  canvas.addEventListener("pointermove", touch);
  canvas.addEventListener("wheel", touch);
  const main = by("main"), stop = event => event.preventDefault();
  main.addEventListener("dragover", event => { stop(event); main.classList.add("dropping"); });
  main.addEventListener("dragleave", () => main.classList.remove("dropping"));
  main.addEventListener("drop", event => { stop(event); main.classList.remove("dropping"); fromFiles(event.dataTransfer.files); });
}

// What tests and pictures ask.
window.gloved = {
  get shown() {
    const stage = rooms[0].stage;
    return {sliders: !by("sliders").hidden, whole: Boolean(stage.meshes), time, playing, live: isLive(), followed, drawn, runs: runs().map(run => run.name), end: end(), banner: by("banner").textContent,
      hand: Boolean(stage.hand), hands: stage.hands.filter(hand => hand?.node.visible).length, objects: [...stage.objects.keys()], forces: stage.forces.filter(f => f.node.visible).length,
      contacts: stage.contacts.filter(c => c.visible).length, polygons: stage.polygons.children.filter(p => p.visible).length,
      lifted: runs()[0].empty ? 0 : runs()[0].around(time).a.object.reduce((z, o) => Math.max(z, o.is_static ? 0 : o.position_m[2] - runs()[0].state(0).object.find(x => x.name === o.name).position_m[2]), 0),
      measured: stage.hand ? stage.hand.measured.filter(m => m.visible).length : 0, preset: camera.preset, eye: camera.eye.position.toArray(), state: by("state").textContent};
  },
};

async function start() {
  wire();
  choose(asked.get("camera") || "palm");
  for (const name of (asked.get("show") ?? "forces,measured,grid").split(",")) if (name in show) show[name] = true;
  if (asked.has("show")) for (const name of Object.keys(show)) show[name] = asked.get("show").split(",").includes(name);
  toggle("grid", show.grid);
  layouts = await (await fetch("/types")).json();
  listen();
  requestAnimationFrame(frame);
  await fromServer((asked.get("log") ?? "0,1").split(",").map(Number));
  if (asked.has("time")) {
    playing = false;
    go(Number(asked.get("time")));
  }
}
start();
