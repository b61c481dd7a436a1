const wish = new URLSearchParams(location.hash.slice(1));
if (wish.has("bare")) document.body.classList.add("bare");
buildReadout();
buildControls();
// Inside another page its theme counts.
const host = window.frameElement && window.frameElement.dataset.theme;
setTheme(host || document.documentElement.dataset.theme || (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));
requestAnimationFrame(() => {
  viewer.set_3d_pane_size();
  seek(wish.has("t") ? +wish.get("t") : data.at);
  // After the card has its text, and so its size.
  frameCamera();
  if (data.autoplay && !wish.has("t") && !wish.has("still")) setPlaying(true);
  requestAnimationFrame(tick);
  window.player = { seek, step, frameCamera, setTheme, setPlaying, layers, start, stop, frames,
    get time() { return now; }, get playing() { return playing; },
    visible: (path) => node(...path).visible,
    colour(path) { const seen = []; node(...path).traverse((o) => { if (o.material) seen.push(o.material.color.toArray()); }); return seen[0]; },
    framedPoints,
    // Where the centre of mass is in the window.
    middle() { viewer.camera.updateMatrixWorld(); return inWindow(centerNow()).toArray().slice(0, 2); },
    picture() { drawFrame(); viewer.render(); } };
  addEventListener("beforeprint", player.picture);  // else the canvas is empty on paper
});
