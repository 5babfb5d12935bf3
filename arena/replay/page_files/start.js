plot.onclick = e => {
  const t = e.offsetX / plot.clientWidth * d.t[d.t.length - 1];
  let s = 0; while (s + 1 < d.t.length && d.t[s + 1] <= t) s++;
  move(s);
};
play.onclick = () => playing ? pause() : start();
el("keys").onclick = KEYS["?"];
el("trails").onchange = el("sensors").onchange = el("track").onchange = draw;
canvas.addEventListener("wheel", e => { e.preventDefault(); zoomed(e.deltaY < 0 ? 1.2 : 1 / 1.2, e.offsetX, e.offsetY); }, {passive: false});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { colours(); draw(); });
colours();
el("seen").onscroll = drawStrips;
scrub.oninput = () => move(Number(scrub.value));
new ResizeObserver(layout).observe(el("stage"));
scrub.max = d.t.length - 1;
el("title").textContent = document.title = d.title;
legend();
clock = d.t[0] || 0;
layout();
chosen = Math.min(Number(new URLSearchParams(location.search).get("robot") ?? -1), d.robots.length - 1);
show(Number(new URLSearchParams(location.search).get("sample") || 0));
layout();
if (new URLSearchParams(location.search).has("play")) start();
if (d.studio) begin();
if (d.live) { el("live").hidden = false; show(d.t.length - 1); setTimeout(poll, POLL_MS); }
