"use strict";
(() => {
const $ = (id) => document.getElementById(id);
const data = JSON.parse($("data").textContent);
const root = document.documentElement;
const style = (name) => getComputedStyle(root).getPropertyValue(name).trim();
const mouse = matchMedia("(hover: hover)").matches;
const config = { displaylogo: false, responsive: true, displayModeBar: mouse ? "hover" : false,
  modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"] };

function layout(x, y, more) {
  const axis = { gridcolor: style("--line"), zerolinecolor: style("--line"), linecolor: style("--soft"), automargin: true };
  return Object.assign({
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false,
    font: { color: style("--ink"), size: 12, family: 'system-ui, "DejaVu Sans", sans-serif' },
    margin: { l: 48, r: 8, t: 8, b: 36 }, hovermode: "closest",
    // On a touch screen a finger on a plot scrolls the page.
    dragmode: mouse ? "zoom" : false,
    modebar: { bgcolor: "rgba(0,0,0,0)", color: style("--soft"), activecolor: style("--accent") },
    xaxis: Object.assign({ title: { text: x, standoff: 4 } }, axis),
    yaxis: Object.assign({ title: { text: y, standoff: 4 } }, axis),
  }, more || {});
}

function drawStairs() {
  if (!data.steps.length) return;
  const steps = data.steps.slice().reverse(), narrow = window.innerWidth < 560;
  const shown = layout("held-out error [noise floors]", "");
  const most = Math.max(...steps.map((s) => s.error));
  // From zero and linear: the length of a bar is the error. The numbers beside the bars tell small ones apart.
  Object.assign(shown.xaxis, { range: [0, (narrow ? 1.35 : 1.15) * Math.max(most, 1.2)], rangemode: "tozero", nticks: narrow ? 4 : 8 });
  Object.assign(shown.yaxis, { title: "", tickfont: { size: narrow ? 10 : 12 } });
  shown.margin.t = 20;
  shown.shapes = [{ type: "line", x0: 1, x1: 1, yref: "paper", y0: 0, y1: 1, line: { color: style("--before"), dash: "dash" }, layer: "below" }];
  shown.annotations = [{ x: 1, xanchor: "left", xref: "x", y: 1.0, yref: "paper", yanchor: "bottom", text: "noise floor", showarrow: false, font: { color: style("--before"), size: 11 } }];
  const label = (text) => narrow && text.length > 24 ? text.replace(" at ", "<br>at ") : text;
  Plotly.react("stairs", [{ type: "bar", orientation: "h", x: steps.map((s) => s.error), y: steps.map((s) => label(s.label)),
    text: steps.map((s) => s.told), textposition: "outside", cliponaxis: false, marker: { color: style("--after") },
    hovertemplate: "%{y}<br>%{x:.4g} noise floors<extra></extra>" }], shown, config);
}

function band(panel) {
  return [{ type: "rect", xref: "paper", x0: 0, x1: 1, y0: -2 * panel.floor, y1: 2 * panel.floor, line: { width: 0 }, fillcolor: style("--band"), layer: "below" }];
}
function unused(run) {
  return run.unused.map(([x0, x1]) => ({ type: "rect", yref: "paper", x0, x1, y0: 0, y1: 1, line: { width: 0 }, fillcolor: style("--unused"), layer: "below" }));
}
const hover = (unit, x) => `${x}: %{x:.4g}<br>%{y:.4g} ${unit}`;

function line(panel, run, values, color, name, more) {
  return { x: run.t, y: values, mode: "lines", line: Object.assign({ color, width: 1.3 }, more), name,
    hovertemplate: hover(panel.unit, "time") + `<extra>${name}</extra>` };
}
// Plots one below the other share their time axis: their left margins must be equal.
function aligned(shown) {
  shown.margin.l = 62; shown.yaxis.automargin = false;
  return shown;
}
function drawTorque(place, panel, run) {
  place.hidden = !run.measured;
  if (!run.measured) return;
  const traces = [line(panel, run, run.measured, style("--ink"), "measured", { width: 2 }),
    line(panel, run, run.given, style("--before"), "model as given")];
  if (data.fitted) traces.push(line(panel, run, run.fitted, style("--after"), "with effects", { dash: "dot", width: 2 }));
  Plotly.react(place, traces, aligned(layout("", `${panel.unit === "N" ? "force" : "torque"} [${panel.unit}]`, { shapes: unused(run) })), config);
}
// What the model as given leaves, and the model with the effects where some were found.
function leftBy(drawn, values) {
  const given = drawn(values.before, style("--before"), "as given");
  return data.fitted ? [given, drawn(values.after, style("--after"), "with effects")] : [given];
}
function drawResidual(place, panel, run) {
  const traces = leftBy((...drawn) => line(panel, run, ...drawn), run);
  Plotly.react(place, traces, aligned(layout("time [s]", `residual [${panel.unit}]`, { shapes: [...band(panel), ...unused(run)] })), config);
}

function drawPanel(panel, places) {
  const run = panel.runs[$("log").selectedIndex];
  drawTorque(places[0], panel, run);
  drawResidual(places[1], panel, run);
  panel.over.forEach((over, k) => {
    const dots = (values, color, name) => ({ x: over.x, y: values, mode: "markers", name, marker: { color, size: 4, opacity: 0.55 },
      hovertemplate: hover(panel.unit, over.name) + `<extra>${name}</extra>` });
    Plotly.react(places[k + 2], leftBy(dots, panel), layout(`${over.name} [${over.unit}]`, k === 0 ? `residual [${panel.unit}]` : "", { shapes: band(panel) }), config);
  });
}

// Plots are drawn when they are opened: a robot with thirty joints must not wait for all of them.
const opened = new Map();
function buildPanels() {
  data.panels.forEach((panel, index) => {
    const box = document.createElement("details"), summary = document.createElement("summary"), grid = document.createElement("div");
    box.className = "panel"; grid.className = "multiples";
    summary.textContent = panel.output;
    box.append(summary, grid);
    $("panels").append(box);
    const places = [0, 1, ...panel.over].map((_, k) => {
      const place = document.createElement("div");
      place.className = k < 2 ? "plot wide" : "plot";
      grid.append(place);
      return place;
    });
    box.addEventListener("toggle", () => {
      if (!box.open) { opened.delete(panel); return; }
      opened.set(panel, places);
      drawPanel(panel, places);
    });
    box.open = index < 3;
  });
}
function drawAll() {
  drawStairs();
  for (const [panel, places] of opened) drawPanel(panel, places);
  drawSignals();
}

// The signals of the log that is played, with a line at the instant shown.
const cursors = [];
function drawSignals() {
  const panel = data.panels[$("joint").selectedIndex];
  if (!panel) return;
  drawTorque($("signal-torque"), panel, panel.runs[0]);
  drawResidual($("signal-residual"), panel, panel.runs[0]);
}
function player() {
  const frame = $("playback").contentWindow;
  return frame && frame.player;
}
function followPlayback() {
  const shown = player();
  for (const { place, line } of cursors) {
    const full = place._fullLayout;
    line.hidden = !shown || !full || place.hidden;
    if (line.hidden) continue;
    const x = full.xaxis.l2p(shown.time - shown.start), size = full._size;
    line.hidden = x < 0 || x > size.w;
    line.style.left = `${size.l + x}px`; line.style.top = `${size.t}px`; line.style.height = `${size.h}px`;
  }
  requestAnimationFrame(followPlayback);
}
function buildSignals() {
  for (const panel of data.panels) $("joint").add(new Option(panel.output));
  const worst = data.panels.map((p) => Math.max(...p.before.map(Math.abs)) / p.floor);
  $("joint").selectedIndex = Math.max(0, worst.indexOf(Math.max(...worst)));
  $("joint").onchange = drawSignals;
  drawSignals();
  for (const id of ["signal-torque", "signal-residual"]) {
    const place = $(id), line = document.createElement("div");
    line.className = "cursor"; line.hidden = true;
    place.append(line);
    cursors.push({ place, line });
    if (place.on) place.on("plotly_click", (event) => { if (player()) player().seek(player().start + event.points[0].x); });
  }
  requestAnimationFrame(followPlayback);
}

// On paper: everything open, light, as wide as the sheet.
let before = null;
function toPaper() {
  before = { theme: root.dataset.theme, closed: [...document.querySelectorAll("details:not([open])")] };
  for (const box of before.closed) box.open = true;
  data.panels.forEach((panel, k) => { const box = $("panels").children[k], places = [...box.querySelectorAll(".plot")];
    opened.set(panel, places); });
  root.dataset.theme = "light";
  // The event may come before the sheet has its width: plots are drawn for what they will have.
  root.classList.add("paper");
  $("shown").textContent = data.logs[$("log").selectedIndex];
  drawAll();
  for (const plot of document.querySelectorAll(".js-plotly-plot")) Plotly.relayout(plot, { autosize: false, width: plot.clientWidth });
}
function fromPaper() {
  if (!before) return;
  root.classList.remove("paper");
  for (const box of before.closed) box.open = false;
  root.dataset.theme = before.theme;
  before = null;
  for (const plot of document.querySelectorAll(".js-plotly-plot")) Plotly.relayout(plot, { autosize: true, width: null });
  drawAll();
}
addEventListener("beforeprint", toPaper);
addEventListener("afterprint", fromPaper);

function setTheme(name) {
  root.dataset.theme = name;
  drawAll();
  $("playback").dataset.theme = name;
  if (player()) player().setTheme(name);
}
function loadPlayback() {
  const frame = $("playback");
  const page = JSON.parse($("page").textContent);
  frame.dataset.theme = root.dataset.theme;
  new IntersectionObserver((seen, observer) => {
    if (!seen.some((entry) => entry.isIntersecting)) return;
    observer.disconnect();
    frame.srcdoc = page;
  }, { rootMargin: "300px" }).observe(frame);
}

// On a phone the rows of wide tables are lines, each with the head of its column.
for (const table of document.querySelectorAll(".stack"))
  for (const row of table.tBodies[0].rows)
    [...row.cells].forEach((cell, k) => { cell.dataset.head = table.tHead.rows[0].cells[k].textContent; });

if (!root.dataset.theme) root.dataset.theme = matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
$("theme").onclick = () => setTheme(root.dataset.theme === "dark" ? "light" : "dark");
$("log").onchange = drawAll;
// A plot follows its place: `responsive` alone follows the window, and a panel that opens or a
// phone that turns changes places without it.
const places = new ResizeObserver((seen) => {
  for (const { target } of seen) if (!root.classList.contains("paper") && target.clientWidth && target._fullLayout
    && Math.abs(target._fullLayout.width - target.clientWidth) > 1) Plotly.Plots.resize(target);
});
buildPanels();
drawStairs();
buildSignals();
for (const plot of document.querySelectorAll(".plot")) places.observe(plot);
loadPlayback();
window.report = { ready: true, setTheme, toPaper };
})();
