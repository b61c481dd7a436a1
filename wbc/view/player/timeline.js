const canvas = $("timeline"), backdrop = document.createElement("canvas");
const LEFT = 66, AXIS = 16;
const span = () => canvas.clientWidth - LEFT - 8;
const xOf = (t) => LEFT + (span() * (t - start)) / (stop - start);
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
  const right = LEFT + span(), xs = Array.from(time, xOf);
  let y = 2;
  if (view.graph) {
    const largest = Math.max(...data.contacts.map((c) => c.largest), 1.5 * data.weight);
    // Square root: an impact ten times the weight must not flatten the standing force.
    const level = (f) => y + view.graph - 2 - (view.graph - 4) * Math.sqrt(Math.max(f, 0) / largest);
    g.fillStyle = soft; g.textAlign = "right"; g.fillText("force", LEFT - 6, y + view.graph / 2);
    g.strokeStyle = line; g.beginPath(); g.moveTo(LEFT, level(data.weight)); g.lineTo(right, level(data.weight)); g.stroke();
    for (const c of data.contacts) {
      g.strokeStyle = data.colours.force; g.lineWidth = 1.2; g.beginPath();
      for (let i = 0; i < frames; i++) { const f = Math.hypot(...at3(c.force, i)); g.lineTo(xs[i], level(f)); }
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
      if (fill) { g.fillStyle = fill; g.fillRect(xs[from], y, xs[Math.min(i, frames - 1)] - xs[from] + 0.6, view.strip); }
    }
    y += view.strip + view.gap;
  }
  const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 60, 120, 300, 600].find((s) => (span() * s) / (stop - start) > 60) || 1200;
  g.textAlign = "center"; g.fillStyle = soft; g.strokeStyle = line;
  for (let t = Math.ceil(start / step) * step; t <= stop + 1e-9; t += step) {
    g.beginPath(); g.moveTo(xOf(t), y); g.lineTo(xOf(t), y + 3); g.stroke();
    g.fillText(`${+t.toFixed(3)} s`, Math.min(xOf(t), width - 16), y + 10);
  }
  for (const group of markGroups()) {
    const at = xOf(group[0].time), many = group.length > 1;
    g.fillStyle = ink; g.beginPath(); g.moveTo(at - 4, 0); g.lineTo(at + 4, 0); g.lineTo(at, 8); g.fill();
    if (many) { g.textAlign = "left"; g.fillText(`${group.length}`, at + 6, 5); }
    g.globalAlpha = 0.5; g.fillRect(at - 0.5, 0, 1, y); g.globalAlpha = 1;
  }
}
// Marks that would lie on one another are one triangle with their number.
function markGroups() {
  const groups = [];
  for (const mark of data.marks) {
    const last = groups[groups.length - 1];
    if (last && xOf(mark.time) - xOf(last[0].time) < 16) last.push(mark); else groups.push([mark]);
  }
  return groups;
}
function drawTimeline() {
  const ratio = window.devicePixelRatio || 1, g = canvas.getContext("2d");
  if (!backdrop.width || !canvas.width) return;
  g.setTransform(1, 0, 0, 1, 0, 0);
  g.clearRect(0, 0, canvas.width, canvas.height);
  g.drawImage(backdrop, 0, 0);
  const x = xOf(now);
  g.setTransform(ratio, 0, 0, ratio, 0, 0);
  g.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--accent");
  g.fillRect(x - 1, 0, 2, canvas.height / ratio - AXIS + 2);
  g.beginPath(); g.arc(x, canvas.height / ratio - AXIS - 2, 4, 0, 7); g.fill();  // above the numbers
  canvas.setAttribute("aria-valuenow", (now - start).toFixed(3));
  canvas.setAttribute("aria-valuemax", (stop - start).toFixed(3));
}
function markNear(px) {
  const group = markGroups().find((g) => Math.abs(xOf(g[0].time) - px) < 8);
  return group && { time: group[0].time, label: group.map((m) => m.label).join("\n") };
}
function scrub(event) {
  const px = event.clientX - canvas.getBoundingClientRect().left;
  const mark = event.type === "pointerdown" && markNear(px);
  seek(mark ? firstFrame(mark.time) : start + ((px - LEFT) / span()) * (stop - start));
}
