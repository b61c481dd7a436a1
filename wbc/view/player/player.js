"use strict";
(() => {
const $ = (id) => document.getElementById(id);
const data = JSON.parse($("scene").textContent);
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const floats = (text) => new Float32Array(bytes(text).buffer);
const colour = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
const mix = (a, b, s) => a.map((x, i) => x + (b[i] - x) * s);
const hexOf = (c) => "rgb(" + c.map((x) => Math.round(255 * x)).join(",") + ")";

// Decode -----------------------------------------------------------------------------------------
const time = floats(data.time);
const frames = time.length, start = time[0], stop = time[frames - 1];
for (const body of [data.robot, data.ghost]) if (body) body.poses = floats(body.poses);
data.com = floats(data.com);
for (const c of data.contacts) { for (const k of ["position", "force", "normal"]) c[k] = floats(c[k]); }
for (const g of data.gears) {
  for (const k of ["torque", "power", "direction"]) g[k] = floats(g[k]);
  if (g.residual) g.residual = floats(g.residual);
}
const MODES = { "1": "forward", "-1": "backward", "0": "stuck" };
const modeColour = Object.fromEntries(Object.entries(data.colours.modes).map(([k, v]) => [k, colour(v)]));
const quiet = colour(data.colours.quiet), over = colour(data.colours.over), under = colour(data.colours.under);
const residualColour = (x) => mix(quiet, x > 0 ? over : under, Math.min(Math.abs(x) / data.residual_span, 1));

// Scene ------------------------------------------------------------------------------------------
const pane = $("pane");
const viewer = new MeshCat.Viewer(pane);
const resize = viewer.set_3d_pane_size;
viewer.set_3d_pane_size = function () { resize.call(viewer, pane.clientWidth, Math.max(pane.clientHeight, 1)); };
for (const command of data.commands) viewer.handle_command_bytearray(bytes(command));
const node = (...path) => viewer.scene_tree.find(["wbc", ...path]).object;
const paint = (object, rgb) => object.traverse((o) => { if (o.material) o.material.color.setRGB(...rgb); });
const onTop = (object) => object.traverse((o) => {
  if (o.material) { o.material.depthTest = false; o.material.transparent = true; o.renderOrder = 10; }
});
const noShadow = (object) => object.traverse((o) => { o.castShadow = false; o.receiveShadow = false; });
viewer.set_property(["Grid"], "visible", false);
viewer.set_property(["Axes"], "visible", false);
const sun = viewer.scene_tree.find(["Lights", "SpotLight", "<object>"]).object;
viewer.set_property(["Lights", "SpotLight"], "visible", true);
sun.castShadow = true; sun.intensity = 0.3; sun.shadow.bias = -0.004; sun.position.set(1.2, -1.6, 4); sun.shadow.radius = 3;
viewer.scene_tree.find(["Lights", "AmbientLight", "<object>"]).object.intensity = 0.5;

const com = { ball: node("com", "ball"), floor: node("com", "floor"), line: node("com", "line") };
Object.values(com).forEach((o) => { onTop(o); noShadow(o); });
for (const c of data.contacts) {
  c.node = { shaft: node("contacts", c.name, "shaft"), head: node("contacts", c.name, "head"),
             cone: node("contacts", c.name, "cone") };
  for (const part of ["shaft", "head"]) { onTop(c.node[part]); }
  Object.values(c.node).forEach(noShadow);
}
for (const g of data.gears) g.node = node("robot", "j" + g.number, "hub");
if (data.ghost) {
  // Where the two coincide the measurement is seen, without flicker.
  const veil = new MeshCat.THREE.MeshPhongMaterial({ color: data.colours.ghost, opacity: 0.35, transparent: true,
    depthWrite: false, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
  for (let k = 1; k < data.ghost.joints; k++) {
    for (const part of node("robot", "j" + k).children) if (part.name !== "hub") node("ghost", "j" + k).add(part.clone());
  }
  node("ghost").traverse((o) => { if (o.material) o.material = veil; });
  noShadow(node("ghost"));
}
node("ground").traverse((o) => { o.castShadow = false; });

// Motion -----------------------------------------------------------------------------------------
const up = new MeshCat.THREE.Vector3(0, 0, 1);
const v1 = new MeshCat.THREE.Vector3(), v2 = new MeshCat.THREE.Vector3();
const q1 = new MeshCat.THREE.Quaternion(), q2 = new MeshCat.THREE.Quaternion();
let now = start, playing = false, speed = 1, lastTick = 0;
const layers = { "centre of mass": data.floor !== null };
if (data.contacts.length) Object.assign(layers, { forces: true, cones: true });
if (data.floating) layers.follow = data.follow;
if (data.ghost) layers.ghost = true;
if (data.gears.some((g) => g.residual)) layers.residual = true;

function locate(t) {
  let low = 0, high = frames - 1;
  while (high - low > 1) { const mid = (low + high) >> 1; if (time[mid] <= t) low = mid; else high = mid; }
  if (t >= time[high]) return [high, high, 0];
  return [low, high, Math.max(0, (t - time[low]) / (time[high] - time[low]))];
}
function place(body, root, i, j, s) {
  for (let k = 0; k < body.joints; k++) {
    const a = 7 * (i * body.joints + k), b = 7 * (j * body.joints + k), p = body.poses;
    const object = body.nodes[k];
    object.position.set(p[a] + s * (p[b] - p[a]), p[a + 1] + s * (p[b + 1] - p[a + 1]),
                        p[a + 2] + s * (p[b + 2] - p[a + 2]));
    q1.set(p[a + 3], p[a + 4], p[a + 5], p[a + 6]);
    q2.set(p[b + 3], p[b + 4], p[b + 5], p[b + 6]);
    object.quaternion.copy(q1.slerp(q2, s));
  }
}
for (const [body, root] of [[data.robot, "robot"], [data.ghost, "ghost"]]) {
  if (body) body.nodes = Array.from({ length: body.joints }, (_, k) => node(root, "j" + k));
}
const at3 = (array, i) => [array[3 * i], array[3 * i + 1], array[3 * i + 2]];

function drawContact(c, i) {
  const force = at3(c.force, i), point = at3(c.position, i), normal = at3(c.normal, i);
  const size = Math.hypot(...force);
  const shown = size > 0.02 * data.weight;
  const full = Math.min(size * data.metres_per_newton, 1.6 * data.reach);
  const shaft = Math.max(full - data.arrow_head, 1e-4);
  c.node.shaft.visible = c.node.head.visible = shown && layers.forces;
  c.node.cone.visible = shown && layers.cones;
  if (!shown) return;
  v1.set(...force).normalize();
  q1.setFromUnitVectors(up, v1);
  c.node.shaft.position.set(...point); c.node.shaft.quaternion.copy(q1); c.node.shaft.scale.set(1, 1, shaft);
  c.node.head.position.set(point[0] + shaft * v1.x, point[1] + shaft * v1.y, point[2] + shaft * v1.z);
  c.node.head.quaternion.copy(q1);
  v2.set(...normal);
  q2.setFromUnitVectors(up, v2);
  c.node.cone.position.set(...point); c.node.cone.quaternion.copy(q2);
  const along = v1.dot(v2), slipping = Math.sqrt(Math.max(0, 1 - along * along)) > c.friction * along + 0.02;
  paint(c.node.cone, colour(slipping ? data.colours.over : data.colours.cone));
}
function drawGear(g, i) {
  const known = !Number.isNaN(g.power[i]);
  let rgb = known ? modeColour[g.direction[i]] : modeColour["0"];
  if (layers.residual && g.residual) rgb = residualColour(g.residual[i]);
  paint(g.node, rgb);
  const swell = 1 + (known && g.largest > 0 ? 0.5 * Math.abs(g.torque[i]) / g.largest : 0);
  g.node.scale.set(swell, swell, 1);
}
let anchor = null;
function drawFrame() {
  const [i, j, s] = locate(now);
  const near = s < 0.5 ? i : j;
  place(data.robot, "robot", i, j, s);
  if (data.ghost) { node("ghost").visible = layers.ghost; if (layers.ghost) place(data.ghost, "ghost", i, j, s); }
  for (const c of data.contacts) drawContact(c, near);
  for (const g of data.gears) drawGear(g, near);
  const center = at3(data.com, i).map((x, k) => x + s * (at3(data.com, j)[k] - x));
  Object.values(com).forEach((o) => { o.visible = layers["centre of mass"]; });
  const floor = data.floor === null ? null : data.floor[near];
  com.ball.position.set(...center);
  com.floor.visible = com.line.visible = layers["centre of mass"] && floor !== null;
  if (floor !== null) {
    com.floor.position.set(center[0], center[1], floor);
    com.line.position.set(center[0], center[1], Math.min(floor, center[2]));
    com.line.scale.set(1, 1, Math.max(Math.abs(center[2] - floor), 1e-4));
  }
  follow(center);
  viewer.set_dirty();
  readout(near);
  drawTimeline();
}

// Camera: its own frame has y up, so (x, y, z) of the world is (x, z, -y) there ------------------
const target = () => viewer.controls.target;
function frameCamera() {
  const box = data.camera, [cx, cy, cz] = box.center;
  viewer.camera.fov = 32;
  const aspect = pane.clientWidth / Math.max(pane.clientHeight, 1);
  const half = Math.tan((viewer.camera.fov * Math.PI) / 360);
  const distance = Math.max(box.height / half, box.width / (half * aspect)) * 0.5 * 1.2 + 0.5 * box.width;
  const [dx, dy, dz] = box.direction;
  target().set(cx, cz, -cy);
  viewer.camera.position.set(cx + distance * dx, cz + distance * dz, -(cy + distance * dy));
  viewer.camera.updateProjectionMatrix();
  anchor = null;
  viewer.controls.update();
  viewer.set_dirty();
}
function follow(center) {
  if (!layers.follow) { anchor = null; return; }
  if (anchor) {
    const dx = center[0] - anchor[0], dz = -(center[1] - anchor[1]);
    target().x += dx; target().z += dz;
    viewer.camera.position.x += dx; viewer.camera.position.z += dz;
  }
  anchor = center;
}

// Readout ----------------------------------------------------------------------------------------
const cells = [];
function buildReadout() {
  const table = $("gears"), withResidual = data.gears.some((g) => g.residual);
  table.innerHTML = "<tr><th>joint</th><th>N m</th><th>W</th><th></th>" + (withResidual ? "<th>residual / floor</th>" : "") + "</tr>";
  for (const g of data.gears) {
    const row = table.insertRow();
    const made = Array.from({ length: withResidual ? 5 : 4 }, () => row.insertCell());
    made[0].textContent = g.name;
    made[3].innerHTML = '<span class="chip"></span>';
    cells.push(made);
  }
  const entry = (c, text) => `<span><i style="background:${c}"></i>${text}</span>`;
  const ghostNote = data.ghost ? `<br>transparent: ${data.ghost.label}` : "";
  $("legend").innerHTML = data.gears.length === 0 ? "" : "power through the teeth: " +
    entry(data.colours.modes["1"], "motor drives") + entry(data.colours.modes["-1"], "joint drives") +
    entry(data.colours.modes["0"], "stuck or idle") +
    (withResidual ? "<br>residual: " + entry(data.colours.over, "measured above the model") +
      entry(data.colours.under, "below") + `(full colour: ${Math.round(data.residual_span)} floors)` : "") + ghostNote;
  if (data.gears.length === 0) $("details").remove();
  else if (window.innerWidth < 560 || window.innerHeight < 500 || data.gears.length > 8) $("details").open = false;
}
const signed = (x, digits) => Number.isNaN(x) ? "–" : (x < 0 ? "−" : "+") + Math.abs(x).toFixed(digits);
function readout(i) {
  $("clock").textContent = `t = ${now.toFixed(3)} s · frame ${i + 1} of ${frames}`;
  data.gears.forEach((g, k) => {
    const [, torque, power, mode, residual] = cells[k];
    torque.textContent = signed(g.torque[i], 1);
    power.textContent = signed(g.power[i], 1);
    const known = !Number.isNaN(g.power[i]), chip = mode.firstChild;
    chip.textContent = known ? MODES[g.direction[i]] : "unknown";
    chip.style.background = known ? data.colours.modes[g.direction[i]] : data.colours.modes["0"];
    if (residual) residual.textContent = g.residual ? signed(g.residual[i], 1) : "–";
  });
}

// Timeline ---------------------------------------------------------------------------------------
const canvas = $("timeline"), backdrop = document.createElement("canvas");
const LEFT = 66, AXIS = 16;
function layout() {
  const strips = data.gears.filter((g) => g.residual || g.power.some((x) => !Number.isNaN(x)));
  const strip = strips.length > 16 ? 4 : strips.length > 8 ? 6 : 11, gap = strip > 8 ? 2 : 1, graph = data.contacts.length ? 30 : 0;
  return { strips, strip, gap, graph, height: AXIS + graph + strips.length * (strip + gap) + 4 };
}
function paintBackdrop() {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, view = layout();
  canvas.style.height = view.height + "px";
  for (const c of [canvas, backdrop]) { c.width = width * ratio; c.height = view.height * ratio; }
  const g = backdrop.getContext("2d"), style = getComputedStyle(document.documentElement);
  const ink = style.getPropertyValue("--ink"), soft = style.getPropertyValue("--soft"), line = style.getPropertyValue("--line");
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.clearRect(0, 0, width, view.height);
  g.font = "11px system-ui, 'DejaVu Sans', sans-serif"; g.textBaseline = "middle";
  const span = width - LEFT - 8, x = (t) => LEFT + (span * (t - start)) / (stop - start);
  let y = 2;
  if (view.graph) {
    const largest = Math.max(...data.contacts.map((c) => c.largest), 1.5 * data.weight);
    // Square root: an impact ten times the weight must not flatten the standing force.
    const level = (f) => y + view.graph - 2 - (view.graph - 4) * Math.sqrt(Math.max(f, 0) / largest);
    g.fillStyle = soft; g.textAlign = "right"; g.fillText("force", LEFT - 6, y + view.graph / 2);
    g.strokeStyle = line; g.beginPath(); g.moveTo(LEFT, level(data.weight)); g.lineTo(LEFT + span, level(data.weight)); g.stroke();
    for (const c of data.contacts) {
      g.strokeStyle = data.colours.force; g.lineWidth = 1.2; g.beginPath();
      for (let i = 0; i < frames; i++) { const f = Math.hypot(...at3(c.force, i)); g.lineTo(x(time[i]), level(f)); }
      g.stroke(); g.lineWidth = 1;
    }
    y += view.graph;
  }
  for (const gear of view.strips) {
    g.fillStyle = soft; g.textAlign = "right";
    if (view.strip > 8) g.fillText(gear.name.length > 10 ? gear.name.slice(0, 9) + "…" : gear.name, LEFT - 6, y + view.strip / 2);
    const shade = (i) => gear.residual && layers.residual ? hexOf(residualColour(gear.residual[i]))
      : Number.isNaN(gear.power[i]) ? null : data.colours.modes[gear.direction[i]];
    for (let i = 0; i < frames;) {
      const fill = shade(i), from = i;
      while (i < frames && shade(i) === fill) i++;
      if (fill) { g.fillStyle = fill; g.fillRect(x(time[from]), y, x(time[Math.min(i, frames - 1)]) - x(time[from]) + 0.6, view.strip); }
    }
    y += view.strip + view.gap;
  }
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60, 120, 300, 600].find((s) => (span * s) / (stop - start) > 60) || 1200;
  g.textAlign = "center"; g.fillStyle = soft; g.strokeStyle = line;
  for (let t = Math.ceil(start / step) * step; t <= stop + 1e-9; t += step) {
    g.beginPath(); g.moveTo(x(t), y); g.lineTo(x(t), y + 3); g.stroke();
    g.fillText(`${+t.toFixed(3)} s`, Math.min(x(t), width - 16), y + 10);
  }
  for (const mark of data.marks) {
    g.fillStyle = ink; g.beginPath(); g.moveTo(x(mark.time) - 4, 0); g.lineTo(x(mark.time) + 4, 0);
    g.lineTo(x(mark.time), 8); g.fill();
    g.globalAlpha = 0.5; g.fillRect(x(mark.time) - 0.5, 0, 1, y); g.globalAlpha = 1;
  }
}
function drawTimeline() {
  const ratio = window.devicePixelRatio || 1, g = canvas.getContext("2d");
  if (!backdrop.width || !canvas.width) return;
  g.setTransform(1, 0, 0, 1, 0, 0);
  g.clearRect(0, 0, canvas.width, canvas.height);
  g.drawImage(backdrop, 0, 0);
  const width = canvas.width / ratio, x = LEFT + ((width - LEFT - 8) * (now - start)) / (stop - start);
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--accent");
  g.fillRect(x - 1, 0, 2, canvas.height / ratio - AXIS + 2);
  g.beginPath(); g.arc(x, canvas.height / ratio - AXIS + 2, 4, 0, 7); g.fill();
  canvas.setAttribute("aria-valuenow", (now - start).toFixed(3));
  canvas.setAttribute("aria-valuemax", (stop - start).toFixed(3));
}
function markNear(px) {
  const span = canvas.clientWidth - LEFT - 8;
  return data.marks.find((m) => Math.abs(LEFT + (span * (m.time - start)) / (stop - start) - px) < 6);
}
function scrub(event) {
  const box = canvas.getBoundingClientRect(), px = event.clientX - box.left;
  const mark = event.type === "pointerdown" && markNear(px);
  seek(mark ? firstFrame(mark.time) : start + ((px - LEFT) / (box.width - LEFT - 8)) * (stop - start));
}

// Control ----------------------------------------------------------------------------------------
// An impact is in the forces of the first frame that is not before it.
const firstFrame = (t) => time.find((x) => x >= t - 1e-6) ?? stop;
function seek(t) { now = Math.min(Math.max(t, start), stop); drawFrame(); }
function step(count) { setPlaying(false); const i = Math.min(Math.max(locate(now)[0] + count, 0), frames - 1); seek(time[i] + 1e-7); }
function setPlaying(on) {
  playing = on;
  $("play").innerHTML = on ? "&#10074;&#10074;" : "&#9654;";
  $("play").setAttribute("aria-label", on ? "pause" : "play");
  if (on && now >= stop) now = start;
  lastTick = 0;
}
function tick(stamp) {
  if (playing) {
    if (lastTick) {
      now += (speed * (stamp - lastTick)) / 1000;
      if (now >= stop) now = start;
      drawFrame();
    }
    lastTick = stamp;
  }
  requestAnimationFrame(tick);
}
function nextMark() {
  if (!data.marks.length) return;
  const later = data.marks.find((m) => m.time > now + 1e-4) || data.marks[0];
  setPlaying(false); seek(firstFrame(later.time));
}
function setTheme(name) {
  document.documentElement.dataset.theme = name;
  const sky = name === "dark" ? [[0.13, 0.15, 0.18], [0.07, 0.08, 0.1]] : [[0.98, 0.985, 0.99], [0.86, 0.88, 0.91]];
  viewer.set_property(["Background"], "top_color", sky[0]);
  viewer.set_property(["Background"], "bottom_color", sky[1]);
  const slab = node("ground");
  paint(slab, colour(name === "dark" ? "#4a525e" : "#a9b1bb"));
  paintBackdrop(); drawTimeline(); viewer.set_dirty();
}
function buildControls() {
  for (const s of [0.05, 0.1, 0.25, 0.5, 1, 2, 4]) $("speed").add(new Option(s + "×", s, s === 1, s === 1));
  $("speed").onchange = (e) => { speed = +e.target.value; };
  $("play").onclick = () => setPlaying(!playing);
  $("back").onclick = () => step(-1);
  $("next").onclick = () => step(1);
  $("mark").onclick = nextMark;
  $("marks-nav").hidden = !data.marks.length;
  $("frame").onclick = () => { frameCamera(); drawFrame(); };
  $("theme").onclick = () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  for (const name of Object.keys(layers)) {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox"; box.checked = layers[name];
    box.onchange = () => { layers[name] = box.checked; if (name === "residual") paintBackdrop(); drawFrame(); };
    label.append(box, " " + name);
    $("layers").append(label);
  }
  let dragging = false;
  canvas.onpointerdown = (e) => { dragging = true; canvas.setPointerCapture(e.pointerId); scrub(e); };
  canvas.onpointermove = (e) => {
    if (dragging) { scrub(e); return; }
    const mark = markNear(e.clientX - canvas.getBoundingClientRect().left);
    canvas.title = mark ? mark.label : "";
  };
  canvas.onpointerup = () => { dragging = false; };
  window.addEventListener("keydown", (e) => {
    if (e.target.tagName === "SELECT") return;
    const keys = { " ": () => setPlaying(!playing), ArrowLeft: () => step(e.shiftKey ? -10 : -1), m: nextMark,
      ArrowRight: () => step(e.shiftKey ? 10 : 1), f: () => { frameCamera(); drawFrame(); }, Home: () => seek(start), End: () => seek(stop) };
    if (keys[e.key]) { e.preventDefault(); keys[e.key](); }
  });
  window.addEventListener("resize", () => { paintBackdrop(); drawFrame(); });
}

const wish = new URLSearchParams(location.hash.slice(1));
if (wish.has("bare")) document.body.classList.add("bare");
buildReadout();
buildControls();
// Inside another page its theme counts.
const host = window.frameElement && window.frameElement.dataset.theme;
setTheme(host || document.documentElement.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
requestAnimationFrame(() => {
  viewer.set_3d_pane_size();
  frameCamera();
  seek(wish.has("t") ? +wish.get("t") : start);
  if (data.autoplay && !wish.has("t") && !wish.has("still")) setPlaying(true);
  requestAnimationFrame(tick);
  window.player = { seek, step, frameCamera, setTheme, setPlaying, layers, start, stop, frames,
    get time() { return now; }, get playing() { return playing; },
    picture() { drawFrame(); viewer.render(); } };
});
})();
