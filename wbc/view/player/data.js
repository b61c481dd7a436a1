const $ = (id) => document.getElementById(id);
const data = JSON.parse($("scene").textContent);
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const floats = (text) => new Float32Array(bytes(text).buffer);
const colour = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
const mix = (a, b, s) => a.map((x, i) => x + (b[i] - x) * s);
const hexOf = (c) => "rgb(" + c.map((x) => Math.round(255 * x)).join(",") + ")";

const time = floats(data.time);
const frames = time.length, start = time[0], stop = time[frames - 1];
for (const body of [data.robot, data.ghost]) if (body) body.poses = floats(body.poses);
data.com = floats(data.com);
for (const c of data.contacts) { for (const k of ["position", "force", "normal"]) c[k] = floats(c[k]); }
for (const g of data.gears) {
  for (const k of ["torque", "power", "direction"]) g[k] = floats(g[k]);
  if (g.residual) g.residual = floats(g.residual);
}
const modeColour = Object.fromEntries(Object.entries(data.colours.modes).map(([k, v]) => [k, colour(v)]));
const quiet = colour(data.colours.quiet), over = colour(data.colours.over), under = colour(data.colours.under);
const residualColour = (x) => mix(quiet, x > 0 ? over : under, Math.min(Math.abs(x) / data.residual_span, 1));
const hasResidual = data.gears.some((g) => g.residual);
// A log without torques tells nothing of its joints.
const told = hasResidual || data.gears.some((g) => g.torque.some((x) => !Number.isNaN(x)));
