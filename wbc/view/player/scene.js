const pane = $("pane");
const viewer = new MeshCat.Viewer(pane);
// The parts of the window that the card leaves free, [left, top, width, height] in px, and the whole.
const parts = {
  all: () => [0, 0, pane.clientWidth, pane.clientHeight],
  right: () => { const x = $("card").offsetLeft + $("card").offsetWidth; return [x, 0, pane.clientWidth - x, pane.clientHeight]; },
  below: () => { const y = $("card").offsetTop + $("card").offsetHeight; return [0, y, pane.clientWidth, pane.clientHeight - y]; },
};
let shownIn = "all";
// The middle of the view lies in the middle of that part, and the field of view is its height's.
function showIn(name) {
  shownIn = name;
  const [x, y, w, h] = parts[name]().map((size, k) => (k < 2 ? size : Math.max(size, 1)));
  viewer.camera.setViewOffset(w, h, -x, -y, Math.max(pane.clientWidth, 1), Math.max(pane.clientHeight, 1));
}
const resize = viewer.set_3d_pane_size;
viewer.set_3d_pane_size = function () { resize.call(viewer, pane.clientWidth, Math.max(pane.clientHeight, 1)); showIn(shownIn); };
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
  c.label = document.createElement("span"); c.label.className = "force"; pane.append(c.label);
}
for (const g of data.gears) g.node = node("robot", "j" + g.number, "hub");
let veil = null;
if (data.ghost) {
  // Where the two coincide the measurement is seen, without flicker.
  veil = new MeshCat.THREE.MeshPhongMaterial({ color: data.colours.ghost, opacity: 0.35, transparent: true,
    depthWrite: false, polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
  for (let k = 1; k < data.ghost.joints; k++) {
    for (const part of node("robot", "j" + k).children) if (part.name !== "hub") node("ghost", "j" + k).add(part.clone());
  }
  node("ghost").traverse((o) => { if (o.material) o.material = veil; });
  noShadow(node("ghost"));
}
node("ground").traverse((o) => { o.castShadow = false; });
