// -- studio: control of the running trial --
let held = null, dragged = false;
async function ask(path, request) {
  const options = {headers: {[d.studio.header]: d.studio.token}};
  if (request) Object.assign(options, {method: "POST", body: JSON.stringify(request)});
  const answer = await fetch(path, options);
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}
async function act(request) {
  el("error").textContent = "";
  try { d.studio.now = await ask("do", request); } catch (error) { el("error").textContent = error.message; }
  showStatus();
}
function showStatus() {
  const now = d.studio.now;
  el("status").textContent = `${now.state}${now.hit ? ": " + now.hit : ""}, quantum ${now.tick}` +
    (now.breakpoints.length ? `, breakpoints: ${now.breakpoints.join(", ")}` : "") +
    (now.debugger ? `: robot ${now.debugger.robot} ${now.debugger.is_connected ? "has a client" : "waits for a client"} of the Debug Adapter Protocol on 127.0.0.1:${now.debugger.port}` : "");
  el("debug").textContent = now.debugger ? "Detach debugger" : "Attach debugger";
  el("run").textContent = now.state === "running" ? "Pause" : "Run";
  draw();
}
async function refresh(failures = 0) {
  try {
    const more = await ask(`more?from=${d.t.length}&epoch=${d.studio.now.epoch}`);
    d.studio.now = more.now;
    if (more.from < d.t.length) {        // the trial has started again
      for (const list of [d.t, d.objects, d.clusters, d.log, d.lights, d.messages, ...Object.values(d.curves)]) list.length = more.from;
      for (const r of d.robots) for (const key in r) r[key].length = more.from;
    }
    delete more.now; delete more.from;
    grow(d, more);
    scrub.max = d.t.length - 1;
    if (sample >= d.t.length || el("follow").checked && !playing) show(d.t.length - 1);
    showStatus();
    if (chosen >= 0) inspect(await ask("inspect?robot=" + chosen));
    el("inspector").hidden = chosen < 0;
    setTimeout(refresh, d.studio.now.state === "paused" ? 500 : 200);
  } catch (error) {
    retry(refresh, failures, el("status"));
  }
}
function hex(value, digits) { return value.toString(16).padStart(digits, "0"); }
function inspect(of) {
  const rows = of.script ? ["scripted robot: no firmware"] : of.lines ? of.lines : [
    `${hex(of.pc, 6)} ${of.place}${of.asleep ? "  asleep" : ""}`, `cycle ${of.cycle}  SR ${hex(of.sr, 4)}`,
    ...[0, 8].map(from => `W${from}`.padEnd(4) + of.w.slice(from, from + 8).map(w => hex(w, 4)).join(" ")),
    ...of.threads.map(one => `${one.name.padEnd(14)} ${one.state.padEnd(9)}` + (one.size === null ? "" : `stack ${one.used ?? "?"} of ${one.size}`)),
    ...of.frames];
  el("inspector").textContent = rows.join("\n");
}
function grip(e) {                       // the robot or object under the pointer
  const near = (places, reach) => places.map(([x, y], i) => [Math.hypot(X(x) - e.offsetX, Y(y) - e.offsetY) - reach(i) * scale, i])
    .sort((a, b) => a[0] - b[0])[0];
  const robot = near(d.studio.now.robots, i => d.bodies[i].radius), object = near(d.studio.now.objects, i => d.kinds[i].radius);
  if (robot && robot[0] < 4) return {kind: "robot", number: robot[1]};
  return object && object[0] < 4 ? {kind: "object", number: object[1]} : null;
}
canvas.onpointerdown = e => {
  held = isNow() && grip(e) || {kind: "floor", x: e.offsetX - panX, y: e.offsetY - panY, at: [e.offsetX, e.offsetY]};
  dragged = false;
};
canvas.onpointermove = e => {
  if (!held) return;
  if (held.kind === "floor") {
    if (!dragged && Math.hypot(e.offsetX - held.at[0], e.offsetY - held.at[1]) < 4) return;
    dragged = true; panX = e.offsetX - held.x; panY = e.offsetY - held.y; draw();
    return;
  }
  dragged = true;
  const place = d.studio.now[held.kind + "s"][held.number];
  place[0] = (e.offsetX - left) / scale; place[1] = (low - e.offsetY) / scale;
  draw();
};
canvas.onpointerup = () => {
  if (held && dragged && held.kind !== "floor") {
    const [x, y] = d.studio.now[held.kind + "s"][held.number];
    act({do: "move", ...held, x, y});
  }
  held = null;
};
const run = () => act(d.studio.now.state === "running" ? {do: "pause"} : {do: "run", pace: Number(el("speed").value)});
const step = () => { el("follow").checked = true; act({do: "step", quanta: 1}); };
const rewind = () => {                   // to the quantum that ended at the shown sample
  const per = d.studio.now.tick ? d.studio.now.t / d.studio.now.tick : d.studio.quantum;
  act({do: "rewind", tick: Math.round((isNow() ? d.studio.now.t : d.t[sample]) / per)});
  el("follow").checked = true;
};
function begin() {
  el("studio").hidden = false; el("live").hidden = false; el("running").textContent = "";
  play.hidden = true;                    // a studio does not play samples: Run advances the trial
  el("run").onclick = run; el("step").onclick = step; el("rewind").onclick = rewind;
  el("send").onchange = e => { if (chosen >= 0) act({do: "send", robot: chosen, text: e.target.value + "\r"}); else el("error").textContent = "select a robot first"; };
  el("breakpoint").onchange = e => { if (chosen >= 0) act({do: "toggle_breakpoint", robot: chosen, place: e.target.value}); else el("error").textContent = "select a robot first"; };
  const debug = () => { if (chosen >= 0 || d.studio.now.debugger) act({do: "debug", robot: Math.max(chosen, 0)}); else el("error").textContent = "select a robot first"; };
  el("debug").onclick = debug;
  Object.assign(KEYS, {" ": run, g: run, ".": step, b: rewind, d: debug});
  el("speed").onchange = () => { if (d.studio.now.state === "running") act({do: "run", pace: Number(el("speed").value)}); };
  show(d.t.length - 1); showStatus(); refresh();
}
