// The camera's own frame has y up: (x, y, z) of the world is (x, z, -y) there.
const target = () => viewer.controls.target;
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
// As near as a part of the window allows: every point of the frame lies inside, with a border of 6 %.
function nearest(points, d, aspect) {
  const half = Math.tan((viewer.camera.fov * Math.PI) / 360) / 1.06, wide = half * aspect;
  const flat = Math.hypot(d[0], d[1]), right = [-d[1] / flat, d[0] / flat, 0];
  const above = [d[1] * right[2] - d[2] * right[1], d[2] * right[0] - d[0] * right[2], d[0] * right[1] - d[1] * right[0]];
  // A point p is inside if |right p - x| < wide (distance - d p), and likewise up: four planes, whose
  // tightest pairs give the middle and the distance.
  const most = (f) => Math.max(...points.map(f));
  const [r1, r2] = [1, -1].map((s) => most((p) => s * dot(p, right) / wide + dot(p, d)));
  const [u1, u2] = [1, -1].map((s) => most((p) => s * dot(p, above) / half + dot(p, d)));
  const distance = Math.max(r1 + r2, u1 + u2) / 2;
  const x = (wide * (r1 - r2)) / 2, y = (half * (u1 - u2)) / 2;
  return { distance, eye: [0, 1, 2].map((k) => x * right[k] + y * above[k] + distance * d[k]) };
}
// Whether the card covers one of the framed points.
function covered() {
  const card = $("card");
  return framedPoints().some(([x, y]) => x < card.offsetLeft + card.offsetWidth && y < card.offsetTop + card.offsetHeight);
}
// Where a point is in the window: 1 is the border.
const inWindow = (p) => v1.set(p[0], p[2], -p[1]).project(viewer.camera);
// The same in px.
function pixels(p) {
  const { x, y } = inWindow(p);
  return [((x + 1) / 2) * pane.clientWidth, ((1 - y) / 2) * pane.clientHeight];
}
// (points, 2) the framed points.
function framedPoints() {
  viewer.camera.updateMatrixWorld();
  return data.camera.points.map(pixels);
}
// In the part of the window where the robot is largest and not behind the card.
function frameCamera() {
  const d = data.camera.direction, points = data.camera.points;
  viewer.camera.fov = 32;
  const look = (name) => {
    const [, , w, h] = parts[name]();
    const { distance, eye } = nearest(points, d, Math.max(w, 1) / Math.max(h, 1));
    const depth = distance - points.reduce((sum, p) => sum + dot(p, d), 0) / points.length;
    const aim = eye.map((e, k) => e - depth * d[k]);
    target().set(aim[0], aim[2], -aim[1]);
    viewer.camera.position.set(eye[0], eye[2], -eye[1]);
    viewer.camera.lookAt(target());
    showIn(name);
    return h / distance;
  };
  const size = { right: look("right"), below: look("below") };
  look("all");
  if (covered()) look(size.right > size.below ? "right" : "below");
  // The points of a robot that moves away are those of its start.
  if (data.follow) shift(at3(data.com, 0), centerNow());
  // The next frame may be a far one: from here the camera follows.
  anchor = layers.follow ? centerNow() : null;
  viewer.controls.update();
  drawFrame();
}
function shift(from, to) {
  const dx = to[0] - from[0], dz = -(to[1] - from[1]);
  target().x += dx; target().z += dz;
  viewer.camera.position.x += dx; viewer.camera.position.z += dz;
}
function follow(center) {
  if (!layers.follow) { anchor = null; return; }
  if (anchor) shift(anchor, center);
  anchor = center;
}
// The size of every force at the tip of its arrow, largest first; one that would cover another waits.
function labelForces() {
  const taken = [], box = [pane.clientWidth, pane.clientHeight];
  viewer.camera.updateMatrixWorld();
  for (const c of [...data.contacts].sort((a, b) => b.size - a.size)) {
    c.label.hidden = !(layers.forces && c.size > 0 && c.tip);
    if (c.label.hidden) continue;
    const [x, y] = pixels(c.tip);
    c.label.textContent = `${Math.round(c.size)} N${c.cut ? " (arrow cut)" : ""}`;
    const width = 8 * c.label.textContent.length;
    c.label.hidden = Math.abs(v1.z) > 1 || taken.some((t) => Math.abs(t[0] - x) < (t[2] + width) / 2 && Math.abs(t[1] - y) < 18);
    if (c.label.hidden) continue;
    taken.push([x, y, width]);
    // Inside the window: a long arrow may leave it.
    c.label.style.left = `${Math.min(Math.max(x, width / 2), box[0] - width / 2)}px`;
    c.label.style.top = `${Math.min(Math.max(y, 20), box[1])}px`;
  }
}
