// The camera's own frame has y up: (x, y, z) of the world is (x, z, -y) there.
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
