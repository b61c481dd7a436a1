const up = new MeshCat.THREE.Vector3(0, 0, 1);
const v1 = new MeshCat.THREE.Vector3(), v2 = new MeshCat.THREE.Vector3();
const q1 = new MeshCat.THREE.Quaternion(), q2 = new MeshCat.THREE.Quaternion();
let now = start, playing = false, speed = 1, lastTick = 0;
const layers = { "centre of mass": data.floor !== null };
// The cones of many contacts would hide the robot.
if (data.contacts.length) Object.assign(layers, { forces: true, cones: data.contacts.length <= 4 });
if (data.floating) layers.follow = data.follow;
if (data.ghost) layers.ghost = true;
if (hasResidual) layers.residual = true;

function locate(t) {
  let low = 0, high = frames - 1;
  while (high - low > 1) { const mid = (low + high) >> 1; if (time[mid] <= t) low = mid; else high = mid; }
  if (t >= time[high]) return [high, high, 0];
  return [low, high, Math.max(0, (t - time[low]) / (time[high] - time[low]))];
}
function place(body, i, j, s) {
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
  const full = Math.min(size * data.metres_per_newton, 0.7 * data.reach);
  const shaft = Math.max(full - data.arrow_head, 1e-4);
  c.node.shaft.visible = c.node.head.visible = shown && layers.forces;
  c.node.cone.visible = shown && layers.cones;
  c.size = shown ? size : 0;
  c.cut = size * data.metres_per_newton > full;
  if (!shown) return;
  v1.set(...force).normalize();
  q1.setFromUnitVectors(up, v1);
  c.node.shaft.position.set(...point); c.node.shaft.quaternion.copy(q1); c.node.shaft.scale.set(1, 1, shaft);
  c.node.head.position.set(point[0] + shaft * v1.x, point[1] + shaft * v1.y, point[2] + shaft * v1.z);
  c.node.head.quaternion.copy(q1);
  c.tip = [0, 1, 2].map((k) => point[k] + full * [v1.x, v1.y, v1.z][k]);
  v2.set(...normal);
  q2.setFromUnitVectors(up, v2);
  c.node.cone.position.set(...point); c.node.cone.quaternion.copy(q2);
  const along = v1.dot(v2), slipping = Math.sqrt(Math.max(0, 1 - along * along)) > c.friction * along + 0.02;
  paint(c.node.cone, colour(slipping ? data.colours.slip : data.colours.cone));
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
function centerNow() {
  const [i, j, s] = locate(now), after = at3(data.com, j);
  return at3(data.com, i).map((x, k) => x + s * (after[k] - x));
}
function drawFrame() {
  const [i, j, s] = locate(now);
  const near = s < 0.5 ? i : j;
  place(data.robot, i, j, s);
  if (data.ghost) { node("ghost").visible = layers.ghost; if (layers.ghost) place(data.ghost, i, j, s); }
  for (const c of data.contacts) drawContact(c, near);
  for (const g of data.gears) drawGear(g, near);
  const center = centerNow();
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
  labelForces();
  viewer.set_dirty();
  readout(near);
  drawTimeline();
}
