"use strict";
const d = JSON.parse(document.getElementById("trial").textContent);
const el = id => document.getElementById(id);
let INK = "#222", LINE = "#bbb", MARK = "#cce5f5";  // `colours` replaces them by those of style.css, light or dark
const canvas = el("view"), g = canvas.getContext("2d"), scrub = el("scrub"), play = el("play");
const strips = el("strips"), h = strips.getContext("2d"), plot = el("plot"), q = plot.getContext("2d");
const SEEN = ["nothing", "object", "robot"];
const SEEN_COLOUR = d.palette.seen, GROUPS = d.palette.groups;
const POLL_MS = 1000, FRAME_MS = 16, FCY = 14745600, TRAIL_S = 30, MARGIN = 14;
const LEDS = ["led0", "led1", "led2", "led3", "led4", "led5", "led6", "led7", "front", "body"];
const STRIP_HEIGHT = 14, STRIP_PIXEL = 8;
const LEAST_ZOOM = d.walls || d.polygon.length ? 1 : 0.02;  // without walls, robots may be far outside the rectangle
const BEARING = Math.PI / 4;             // angle between two ring LEDs, which follow clockwise from the front
let PLOT_HEIGHT = 62, plotWidth = 384, sample = 0, playing = false, clock = 0, last = 0, chosen = -1, scale = 1, left = 0, low = 0;
let zoom = 1, panX = 0, panY = 0;        // zoom and offset in pixels; 1, 0, 0 shows the whole arena in the middle
const X = x => left + x * scale, Y = y => low - y * scale;

function sized(c, width, height) {       // gives a canvas as many pixels as the screen has
  const ratio = window.devicePixelRatio || 1;
  c.width = Math.round(width * ratio); c.height = Math.round(height * ratio);
  c.style.width = width + "px"; c.style.height = height + "px";
  c.getContext("2d").setTransform(ratio, 0, 0, ratio, 0, 0);
}
function layout() {
  const box = el("stage"), width = Math.max(box.clientWidth, 50), height = Math.max(box.clientHeight, 50);
  sized(canvas, width, height);
  PLOT_HEIGHT = innerHeight < 650 || innerWidth <= 820 ? 40 : 62;
  plotWidth = Math.max(Math.min(el("legend").clientWidth, 800), 200);
  const rows = d.robots.length * STRIP_HEIGHT || 1;
  el("rows").style.height = rows + "px";
  sized(strips, 384, Math.min(rows, el("seen").clientHeight || rows, innerHeight));  // the rows on screen: canvases have a limit
  sized(plot, plotWidth, Math.max(d.metrics.length, 1) * PLOT_HEIGHT);
  draw();
}
function colours() {                     // reads the colours of the light or dark style
  const style = getComputedStyle(document.documentElement);
  [INK, LINE, MARK] = ["--ink", "--line", "--mark"].map(name => style.getPropertyValue(name).trim());
}
function place(part) {                   // scale and origin of the view
  const width = canvas.clientWidth, height = canvas.clientHeight;
  scale = zoom * Math.min((width - 2 * MARGIN) / d.width, (height - 2 * MARGIN - 16) / d.height);
  if (el("track").checked && chosen >= 0) {
    const [x, y] = pose(chosen, part);
    panX = (d.width / 2 - x) * scale; panY = (y - d.height / 2) * scale;
  }
  left = (width - d.width * scale) / 2 + panX; low = (height - 16 + d.height * scale) / 2 + panY;
}
function zoomed(by, x, y) {              // keeps the point of the floor under the pointer
  const before = zoom;
  zoom = Math.min(Math.max(zoom * by, LEAST_ZOOM), 40);
  const real = zoom / before, middleX = canvas.clientWidth / 2, middleY = (canvas.clientHeight - 16) / 2;
  panX = (panX + middleX - x) * real - middleX + x; panY = (panY + middleY - y) * real - middleY + y;
  if (zoom === 1) panX = panY = 0;
  draw();
}
function disc(x, y, r, fill) {
  g.beginPath(); g.arc(X(x), Y(y), r * scale, 0, 2 * Math.PI); g.fillStyle = fill; g.fill(); g.stroke();
}
function dot(x, y, fill) {               // an LED, visible at any scale
  g.beginPath(); g.arc(X(x), Y(y), Math.max(0.8 * scale, 3.5), 0, 2 * Math.PI); g.fillStyle = fill; g.fill(); g.stroke();
}
function shape(one, fill) {
  g.beginPath();
  if (one.polygon.length) one.polygon.forEach(([x, y]) => g.lineTo(X(x), Y(y)));
  else g.arc(X(one.x), Y(one.y), one.radius * scale, 0, 2 * Math.PI);
  g.closePath(); if (fill) { g.fillStyle = fill; g.fill(); }
}
function lit(robot) {                    // LEDs that are on now or were on since the previous sample
  return d.lights[sample].reduce((leds, l) => l.robot === robot ? leds | l.leds : leds, d.robots[robot].leds[sample]);
}
function isKilobot(robot) { return d.bodies[robot].kind === "kilobot"; }
function colour(robot) {                 // colour of a Kilobot's LED at the present time; grey if it is dark
  let leds = d.robots[robot].leds[sample];
  for (const l of d.lights[sample + 1] || []) if (l.robot === robot && l.cycle / FCY <= clock) leds = l.leds;
  return leds ? `rgb(${85 * (leds & 3)} ${85 * (leds >> 2 & 3)} ${85 * (leds >> 4 & 3)})` : "#ddd";
}
function ledNames(robot, leds) {
  if (isKilobot(robot)) return leds ? `red ${leds & 3} green ${leds >> 2 & 3} blue ${leds >> 4 & 3}` : "";
  return LEDS.filter((_, bit) => leds >> bit & 1).join(" ");
}
function share() {                       // elapsed share of the time to the next sample
  if (sample + 1 >= d.t.length) return 0;
  return Math.min(Math.max((clock - d.t[sample]) / (d.t[sample + 1] - d.t[sample]), 0), 1);
}
function between(values, part) {
  return part ? values[sample] + part * (values[sample + 1] - values[sample]) : values[sample];
}
function isNow() {                       // whether the page shows the present of the trial, not a sample
  return d.studio && el("follow").checked && !playing;
}
function pose(i, part) {
  if (isNow()) return d.studio.now.robots[i];
  const r = d.robots[i];
  let turn = part ? r.heading[sample + 1] - r.heading[sample] : 0;
  turn -= 2 * Math.PI * Math.round(turn / (2 * Math.PI));
  return [between(r.x, part), between(r.y, part), r.heading[sample] + part * turn];
}
function events(robot) { return d.faults.filter(([who, t]) => who === robot && t <= d.t[sample]); }
function drawGround() {
  g.strokeStyle = INK; g.lineWidth = 1;
  d.patches.forEach(one => shape(one, one.colour));
  d.lamps.forEach(one => { g.strokeStyle = "#e69f00"; g.beginPath(); g.arc(X(one.x), Y(one.y), 6, 0, 7);
    g.moveTo(X(one.x) - 9, Y(one.y)); g.lineTo(X(one.x) + 9, Y(one.y)); g.moveTo(X(one.x), Y(one.y) - 9);
    g.lineTo(X(one.x), Y(one.y) + 9); g.stroke(); });
  g.strokeStyle = INK; g.lineWidth = 2;
  if (d.polygon.length) { shape({polygon: d.polygon}); g.stroke(); }
  else {
    if (!d.walls) g.setLineDash([4, 4]);
    g.strokeRect(X(0), Y(d.height), d.width * scale, d.height * scale);
    g.setLineDash([]);
  }
  g.lineWidth = 1;
  d.obstacles.forEach(one => { shape(one, one.colour); g.stroke(); });
  const bar = [10000, 5000, 1000, 500, 100, 50, 10].find(one => one <= d.width / zoom / 3) || 1, foot = canvas.clientHeight - 10;
  g.fillStyle = INK; g.fillRect(MARGIN, foot, bar * scale, 3); g.fillText(`${bar} cm`, MARGIN + bar * scale + 5, foot + 5);
}
function drawTrails() {
  let first = sample;
  while (first > 0 && d.t[sample] - d.t[first] < TRAIL_S) first--;
  d.robots.forEach((r, i) => {
    if (chosen >= 0 && chosen !== i) return;
    g.beginPath();
    for (let s = first; s <= sample; s++) g.lineTo(X(r.x[s]), Y(r.y[s]));
    g.strokeStyle = GROUPS[i % GROUPS.length]; g.stroke();
  });
  g.strokeStyle = INK;
}
function drawSensors(part) {             // axes of camera and infrared sensors, also through bodies that block them
  d.robots.forEach((r, i) => {
    if (chosen >= 0 && chosen !== i || isKilobot(i)) return;
    const [x, y, a] = pose(i, part), from = d.bodies[i].radius;
    const line = (angle, length) => {
      g.beginPath(); g.moveTo(X(x + from * Math.cos(angle)), Y(y + from * Math.sin(angle)));
      g.lineTo(X(x + (from + length) * Math.cos(angle)), Y(y + (from + length) * Math.sin(angle))); g.stroke();
    };
    g.strokeStyle = SEEN_COLOUR[r.seen[sample]] || INK; line(a, d.sight);
    g.strokeStyle = "#cc79a7"; d.infrared.bearings.forEach(bearing => line(a - bearing, d.infrared.range));
  });
  g.strokeStyle = INK;
}
function drawLinks(part) {               // thin: a Bluetooth link; thick: a message since the previous sample
  for (const [one, other] of d.links) {
    const [x, y] = pose(one, part), [u, v] = pose(other, part);
    const used = d.messages[sample].some(m => m.robot === one && m.to === other || m.robot === other && m.to === one);
    g.beginPath(); g.moveTo(X(x), Y(y)); g.lineTo(X(u), Y(v));
    g.lineWidth = used ? 2.5 : 0.5; g.strokeStyle = "#cc79a7"; g.stroke();
  }
  g.lineWidth = 1; g.strokeStyle = INK;
}
function draw() {
  const part = share();
  place(part);
  g.clearRect(0, 0, canvas.width, canvas.height);
  g.font = h.font = q.font = "11px sans-serif";
  drawGround();
  if (el("trails").checked) drawTrails();
  const sizes = {};
  for (const c of d.clusters[sample]) sizes[c] = (sizes[c] || 0) + 1;
  d.objects[sample].forEach(([x, y, a], i) => {
    const c = d.clusters[sample][i], kind = d.kinds[i];
    if (isNow()) [x, y, a] = d.studio.now.objects[i];
    else if (part) { const next = d.objects[sample + 1][i]; x += part * (next[0] - x); y += part * (next[1] - y); a += part * (next[2] - a); }
    const grouped = sizes[c] > 1;
    if (grouped) { g.lineWidth = 3; g.strokeStyle = GROUPS[c % GROUPS.length]; }
    if (kind.polygon.length) { shape({polygon: kind.polygon.map(([u, v]) => [x + u * Math.cos(a) - v * Math.sin(a), y + u * Math.sin(a) + v * Math.cos(a)])}, kind.colour); g.stroke(); }
    else disc(x, y, kind.radius, kind.colour);
    g.lineWidth = 1; g.strokeStyle = INK;
  });
  drawLinks(part);
  if (el("sensors").checked) drawSensors(part);
  d.robots.forEach((r, i) => {
    const [x, y, a] = pose(i, part), radius = d.bodies[i].radius, ahead = isKilobot(i) ? radius : 8;
    disc(x, y, radius, isKilobot(i) ? colour(i) : SEEN_COLOUR[r.seen[sample]] || "#6688aa");
    g.beginPath(); g.moveTo(X(x), Y(y)); g.lineTo(X(x + ahead * Math.cos(a)), Y(y + ahead * Math.sin(a))); g.stroke();
    const on = isKilobot(i) ? 0 : lit(i);
    for (let led = 0; led < 8; led++) if (on >> led & 1) {
      const b = a - led * BEARING;
      dot(x + radius * Math.cos(b), y + radius * Math.sin(b), "#f00");
    }
    if (on >> 8 & 1) dot(x + (radius + 1.5) * Math.cos(a), y + (radius + 1.5) * Math.sin(a), "#fb0");
    if (on >> 9 & 1) dot(x, y, "#0f0");
    if (events(i).length || i === chosen) {
      g.beginPath(); g.arc(X(x), Y(y), (radius + 3) * scale, 0, 2 * Math.PI);
      g.lineWidth = 2; g.strokeStyle = i === chosen ? "#0072b2" : "#d55e00"; g.stroke(); g.lineWidth = 1; g.strokeStyle = INK;
    }
    g.fillStyle = INK; g.fillText(i, X(x) + 8, Y(y) - 8);
  });
  scrub.value = sample;
  el("state").textContent = `${isNow() ? d.studio.now.t.toFixed(3) : d.t[sample].toFixed(1)} s, ` +
    d.metrics.map(m => `${m.label} ${shown(m, sample)}`).join(", ");
  drawPlot(); drawChosen(); drawStrips(); drawLog();
}
function label(m, value) { return `${Number((m.scale * value).toPrecision(3))}`; }
function shown(m, s) { return d.curves[m.name][s] === null ? "-" : `${Number((m.scale * d.curves[m.name][s]).toPrecision(3))}${m.unit ? " " + m.unit : ""}`; }
function drawPlot() {
  const width = plotWidth, end = d.t[d.t.length - 1] || 1;
  q.clearRect(0, 0, width, plot.height);
  d.metrics.forEach((m, row) => {
    const values = d.curves[m.name], top = row * PLOT_HEIGHT + 13, high = PLOT_HEIGHT - 18;
    const most = m.best || values.reduce((a, b) => Math.max(a, b), 1e-9), least = values.reduce((a, b) => Math.min(a, b), 0);
    const y = v => top + high - (v - least) / (most - least) * high;
    q.strokeStyle = LINE; q.strokeRect(0.5, top - 0.5, width - 1, high + 1);
    q.fillStyle = INK; q.fillText(`${m.label}${m.unit ? ` (${m.unit})` : ""}: ${shown(m, sample)}`, 2, top - 3);
    q.beginPath(); q.strokeStyle = "#0072b2";
    const step = Math.max(Math.floor(values.length / 1500), 1);
    for (let s = 0, gap = true; s < values.length; s += step) {
      if (values[s] !== null) q[gap ? "moveTo" : "lineTo"](d.t[s] / end * width, y(values[s]));
      gap = values[s] === null;
    }
    q.stroke();
    q.fillStyle = INK; q.textAlign = "right";
    q.fillText(label(m, most), width - 3, top + 9); q.fillText(label(m, least), width - 3, top + high - 2);
    q.fillText(`${end.toFixed(0)} s`, width - 3, top - 3); q.textAlign = "left";
    q.beginPath(); q.strokeStyle = "#d55e00"; const at = clock / end * width; q.moveTo(at, top); q.lineTo(at, top + high); q.stroke();
  });
}
function drive(robot) {                  // text of an e-puck's wheel speeds and sensor, or a Kilobot's duties and LED
  const r = d.robots[robot], of = by => `${(by * r.left[sample]).toFixed(0)}, ${(by * r.right[sample]).toFixed(0)}`;
  if (isKilobot(robot)) return `motors ${of(1)} of 255  LED ${ledNames(robot, r.leds[sample]) || "off"}`;
  return `wheels ${of(10)} mm/s  sees ${SEEN[r.seen[sample]] || "?"}`;
}
function drawChosen() {
  if (chosen < 0) { el("chosen").textContent = "click a robot, or press n"; return; }
  const r = d.robots[chosen], what = events(chosen).map(([, t, why]) => `${t.toFixed(1)} s ${why}`).join("\n");
  el("chosen").textContent = `robot ${chosen}${d.names[chosen]}  at ${r.x[sample].toFixed(1)}, ${r.y[sample].toFixed(1)} cm, ` +
    `${((r.heading[sample] * 180 / Math.PI % 360 + 360) % 360).toFixed(0)}°\n${drive(chosen)}  load ${(100 * r.load[sample]).toFixed(0)} %` +
    (what ? "\n" + what : "");
}
function drawStrips() {
  h.clearRect(0, 0, strips.width, strips.height);
  const above = el("seen").scrollTop, first = Math.floor(above / STRIP_HEIGHT);
  const count = Math.ceil(strips.clientHeight / STRIP_HEIGHT) + 1;
  d.robots.slice(first, first + count).forEach((r, row) => {
    const i = first + row, y = i * STRIP_HEIGHT - above, bytes = atob(r.strip[sample]);
    if (i === chosen) { h.fillStyle = MARK; h.fillRect(0, y, 384, STRIP_HEIGHT); }
    h.fillStyle = INK; h.fillText(i, 2, y + 11);
    for (let p = 0; p + 2 < bytes.length; p += 3) {
      h.fillStyle = `rgb(${bytes.charCodeAt(p)} ${bytes.charCodeAt(p + 1)} ${bytes.charCodeAt(p + 2)})`;
      h.fillRect(20 + p / 3 * STRIP_PIXEL, y + 1, STRIP_PIXEL, STRIP_HEIGHT - 2);
    }
    if (bytes.length) {                  // a border in the colour of the class that the controller saw
      h.strokeStyle = SEEN_COLOUR[r.seen[sample]] || LINE; h.lineWidth = 2;
      h.strokeRect(20, y + 1, bytes.length / 3 * STRIP_PIXEL, STRIP_HEIGHT - 2);
    }
    h.fillStyle = INK;
    if (isKilobot(i)) {
      h.fillStyle = colour(i); h.fillRect(20, y + 1, 2 * STRIP_PIXEL, STRIP_HEIGHT - 2);
      h.fillStyle = INK; h.fillText(drive(i), 26 + 2 * STRIP_PIXEL, y + 11);
      return;
    }
    h.fillText(`${SEEN[r.seen[sample]] || "?"} ${(100 * r.load[sample]).toFixed(0)} % ` + ledNames(i, lit(i)), 26 + 20 * STRIP_PIXEL, y + 11);
  });
}
function drawLog() {
  const lines = [];
  for (let s = sample; s >= 0 && lines.length < 40; s--) {
    const said = d.log[s].concat(d.lights[s], d.messages[s]).filter(l => chosen < 0 || l.robot === chosen || l.to === chosen)
      .sort((a, b) => b.cycle - a.cycle);
    for (const l of said) lines.push(`${(l.cycle / FCY).toFixed(3)} s  robot ${l.robot}${l.to === undefined ? "" : " → " + (l.to < 0 ? "all" : l.to)}  ` +
      (l.text === undefined ? "LEDs " + (ledNames(l.robot, l.leds) || "off") : l.text));
  }
  for (const [robot, t, why] of d.faults) if (t <= d.t[sample]) lines.unshift(`${t.toFixed(1)} s  robot ${robot} ${why}`);
  el("log").textContent = lines.join("\n");
}
function legend() {
  const rows = [["robot sees nothing", SEEN_COLOUR[0]], ["an object", SEEN_COLOUR[1]], ["a robot", SEEN_COLOUR[2]]];
  const kinds = new Map(d.kinds.map(one => [one.name, one.colour]));
  for (const [name, colour] of kinds) rows.push([name || "object", colour]);
  if (d.grouped) rows.push(["ring: objects of one group", GROUPS[0]]);
  d.obstacles.concat(d.patches).forEach(one => rows.push([one.name, one.colour]));
  if (d.lamps.length) rows.push(["lamp", "#e69f00"]);
  if (d.links.length) rows.push(["Bluetooth, thick while used", "#cc79a7"]);
  rows.push(["front LED", "#fb0"], ["fault or warning", "#d55e00"]);
  for (const [words, colour] of rows) {
    const row = document.createElement("span"), mark = document.createElement("i");
    mark.style.background = colour; row.append(mark, words); el("legend").append(row);
  }
}
