// An impact is in the forces of the first frame that is not before it.
const firstFrame = (t) => time.find((x) => x >= t - 1e-6) ?? stop;
function seek(t) { now = Math.min(Math.max(t, start), stop); drawFrame(); }
// From the frame that is shown, which is the nearest one.
function step(count) {
  setPlaying(false);
  const [before, after, share] = locate(now), shown = share < 0.5 ? before : after;
  seek(time[Math.min(Math.max(shown + count, 0), frames - 1)] + 1e-7);
}
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
  $("mark").textContent = `next ${data.mark_name}`;
  $("mark").title = `to the next ${data.mark_name} (m)`;
  $("mark").setAttribute("aria-label", `to the next ${data.mark_name}`);
  $("marks-nav").hidden = !data.marks.length;
  $("frame").onclick = frameCamera;
  $("theme").onclick = () => setTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  for (const name of Object.keys(layers)) {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox"; box.checked = layers[name];
    box.onchange = () => { layers[name] = box.checked; if (name === "residual") { paintBackdrop(); drawLegend(); } drawFrame(); };
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
      ArrowRight: () => step(e.shiftKey ? 10 : 1), f: frameCamera, Home: () => seek(start), End: () => seek(stop) };
    if (keys[e.key]) { e.preventDefault(); keys[e.key](); }
  });
  window.addEventListener("resize", () => { paintBackdrop(); drawFrame(); });
  // The camera moved: the numbers stay at their arrows.
  viewer.controls.addEventListener("change", labelForces);
}
