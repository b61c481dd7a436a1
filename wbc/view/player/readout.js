const cells = [];
function buildReadout() {
  const table = $("gears"), units = [...new Set(data.gears.map((g) => g.unit))];
  table.innerHTML = "<tr><th>joint</th><th>" + units.join(" or ") + "</th><th>W</th><th></th>" + (hasResidual ? "<th>residual<br>[noise floors]</th>" : "") + "</tr>";
  for (const g of data.gears) {
    const row = table.insertRow();
    const made = Array.from({ length: hasResidual ? 5 : 4 }, () => row.insertCell());
    made[0].textContent = g.name;
    made[3].innerHTML = '<span class="chip"></span>';
    cells.push(made);
  }
  drawLegend();
  table.hidden = !told;  // a table without a number would only cover the robot
  if (!told && data.contacts.length === 0) $("details").hidden = true;
  else if (window.innerWidth < 560 || window.innerHeight < 500 || data.gears.length > 8) $("details").open = false;
}
// Joints show one thing at a time: while they have the colour of their residual, no other entry has colours like it.
const residualShown = () => Boolean(layers.residual);
function drawLegend() {
  const entry = (c, text) => `<span><i style="background:${c}"></i>${text}</span>`;
  const lines = data.planned ? ["planned motion: torques that the model needs, of their limits; line: path of the contact point"] : [];
  if (told && residualShown()) lines.push("residual: " + entry(data.colours.over, "measured above the model") +
    entry(data.colours.under, "below") + `(full colour: ${Math.round(data.residual_span)} noise floors)`);
  else if (told) lines.push("power through the gear: " + ["1", "-1", "0"].map((m) => entry(data.colours.modes[m], data.modes[m])).join(""));
  // Beside joints in the colours of the power the ghost has a third one.
  const ghostColour = residualShown() || !told ? data.colours.ghost : data.colours.other_ghost;
  if (veil) veil.color.set(ghostColour);
  if (data.ghost) lines.push(entry(ghostColour, `transparent: ${data.ghost.label}`));
  // A length that is easy to compare with the robot, and the force that it stands for.
  const newtons = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000].find((n) => n * data.metres_per_newton > 0.25 * data.reach) || 10000;
  if (data.contacts.length) lines.push(`force arrow: ${newtons} N = ${(newtons * data.metres_per_newton).toPrecision(2)} m`);
  $("legend").innerHTML = lines.join("<br>");
}
const signed = (x, digits) => Number.isNaN(x) ? "–" : (Number(x.toFixed(digits)) < 0 ? "−" : "+") + Math.abs(x).toFixed(digits);
function readout(i) {
  $("clock").textContent = `t = ${now.toFixed(3)} s · frame ${i + 1} of ${frames}`;
  // What is marked between the frame before and this one happens now.
  const mark = data.marks.find((m) => m.time <= time[i] + 1e-6 && (i === 0 || m.time > time[i - 1] + 1e-6));
  $("note").textContent = mark ? mark.label : "";
  data.gears.forEach((g, k) => {
    const [, torque, power, mode, residual] = cells[k];
    torque.textContent = signed(g.torque[i], 1) + (data.planned && g.limit !== null ? ` of ${g.limit.toFixed(0)}` : "");
    torque.style.color = data.planned && g.limit !== null && Math.abs(g.torque[i]) > g.limit ? data.colours.slip : "";
    power.textContent = signed(g.power[i], 1);
    const known = !Number.isNaN(g.power[i]), chip = mode.firstChild;
    chip.hidden = !known;
    chip.textContent = known ? data.modes[g.direction[i]] : "";
    chip.style.background = data.colours.modes[known && !residualShown() ? g.direction[i] : "0"];
    if (residual) residual.textContent = g.residual ? signed(g.residual[i], 1) : "–";
  });
}
