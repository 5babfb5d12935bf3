// Shows what the studio waits for, and opens its page as soon as the trial is ready.
const d = JSON.parse(document.getElementById("trial").textContent), POLL_MS = 250, begun = Date.now();
const list = document.getElementById("stages");

function show(stage, problem) {
  const seconds = Math.round((Date.now() - begun) / 1000);
  const lines = d.stages.map((name, n) => `${n < stage ? "\u2713" : n === stage ? "\u25b6" : "\u00a0"} ${name}`);
  list.textContent = [...lines, "", problem || `${seconds} s`].join("\n");
}

async function poll(stage) {
  try {
    const now = await (await fetch("progress", {headers: {[d.header]: d.token}})).json();
    if (now.is_ready) { location.reload(); return; }
    show(stage = now.stage);
  } catch {
    show(stage, "The studio does not answer. If it has ended, its terminal says why.");
  }
  setTimeout(poll, POLL_MS, stage);
}
show(0);
poll(0);
