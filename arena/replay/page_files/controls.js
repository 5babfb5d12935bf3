function show(s) { sample = Math.min(Math.max(Math.round(s), 0), d.t.length - 1); clock = d.t[sample]; draw(); }
function move(s) { el("follow").checked = false; show(s); }
function frame() {
  if (!playing) return;
  const now = performance.now();
  clock += (now - last) / 1000 * Number(el("speed").value);
  last = now;
  while (sample + 1 < d.t.length && d.t[sample + 1] <= clock) sample++;
  if (sample + 1 >= d.t.length) { clock = d.t[sample]; pause(); } else next();
  draw();
}
function next() { setTimeout(frame, FRAME_MS); }
function start() {
  if (sample + 1 >= d.t.length) show(0);
  playing = true; last = performance.now(); play.textContent = "Pause record"; next();
}
function pause() { playing = false; play.textContent = "Play record"; }
function choose(robot) {
  chosen = robot < 0 ? -1 : robot % d.robots.length;
  const seen = el("seen"), row = chosen * STRIP_HEIGHT;
  if (chosen >= 0 && (row < seen.scrollTop || row + STRIP_HEIGHT > seen.scrollTop + seen.clientHeight)) seen.scrollTop = row;
  draw();
}
function grow(whole, more) {             // appends to arrays over the samples, replaces the rest
  for (const key in more)
    if (key === "curves") for (const name in more.curves) d.curves[name].push(...more.curves[name]);
    else if (key === "robots") more.robots.forEach((r, i) => grow(d.robots[i], r));
    else if (key !== "faults" && Array.isArray(more[key])) whole[key].push(...more[key]);
    else whole[key] = more[key];
}
function retry(again, failures, status) { // calls `again` later: after 1, 2, 4, at most 10 seconds
  const seconds = Math.min(2 ** failures, 10);
  status.textContent = `connection lost; next attempt in ${seconds} s`;
  setTimeout(again, 1000 * seconds, failures + 1);
}
async function poll(failures = 0) {
  try {
    const more = await (await fetch("more?from=" + d.t.length)).json();
    grow(d, more);
    scrub.max = d.t.length - 1;
    el("running").textContent = more.state;
    if (el("follow").checked && !playing) show(d.t.length - 1);
    if (more.state === "running") setTimeout(poll, POLL_MS);
  } catch (error) {
    retry(poll, failures, el("running"));
  }
}
function faster(by) { const s = el("speed"); s.selectedIndex = Math.min(Math.max(s.selectedIndex + by, 0), s.length - 1); }
const KEYS = {
  " ": () => playing ? pause() : start(), ArrowLeft: e => move(sample - (e.shiftKey ? 10 : 1)),
  ArrowRight: e => move(sample + (e.shiftKey ? 10 : 1)), Home: () => move(0), End: () => move(d.t.length - 1),
  "+": () => faster(1), "-": () => faster(-1), n: () => choose(chosen + 1), p: () => choose(chosen < 1 ? d.robots.length - 1 : chosen - 1),
  t: () => { el("trails").checked = !el("trails").checked; draw(); }, Escape: () => choose(-1),
  "?": () => { el("help").hidden = !el("help").hidden; },
  s: () => { el("sensors").checked = !el("sensors").checked; draw(); },
  f: () => { el("track").checked = !el("track").checked; draw(); },
  0: () => { zoom = 1; panX = panY = 0; el("track").checked = false; draw(); },
};
document.addEventListener("keydown", e => {
  if (e.ctrlKey || e.metaKey || e.altKey || !KEYS[e.key]) return;
  const kind = e.target.type;
  if (kind === "text" || kind === "select-one") return;
  if ((kind === "button" || kind === "submit" || kind === "checkbox") && e.key === " ") return;  // the browser handles the key
  if (kind === "range" && /^(Arrow|Home|End|Page)/.test(e.key)) return;
  e.preventDefault(); KEYS[e.key](e);
});
canvas.onclick = e => {
  if (dragged) { dragged = false; return; }
  const near = d.robots.map((_, i) => { const [x, y] = pose(i, share()); return [Math.hypot(X(x) - e.offsetX, Y(y) - e.offsetY), i]; });
  near.sort((a, b) => a[0] - b[0]);
  choose(near.length && near[0][0] < Math.max(2.5 * d.bodies[near[0][1]].radius * scale, 15) ? near[0][1] : -1);
};
