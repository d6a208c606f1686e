// What is switched, and what follows the sweep: the table of stamps, the address (#sweep=12).

const byId = (id) => document.getElementById(id);
const slider = byId("slider");
slider.max = String(seen.sweeps.length - 1);

const KINDS = { sweep: "sweep", image: "image", boxes: "boxes", motion: "ego motion" };

function fillTable() {
  const now = sweep();
  byId("stamps").replaceChildren(...seen.streams.map((stream) => {
    const row = document.createElement("tr"), one = stream.rows[state.at];
    const cells = [stream.sensor, KINDS[stream.kind]];
    if (one) {
      const [seq, stamp, arrival] = one;
      cells.push(String(seq), seconds(stamp), signed((stamp - now.stamp_ns) / 1e6), seconds(arrival), signed((arrival - stamp) / 1e6));
    } else cells.push("", "none yet", "", "", "");
    cells.forEach((text, i) => { tag(i ? "td" : "th", i < 2 ? "l" : "", row).textContent = text; });
    return row;
  }));
}

function sayWhere() {
  const now = sweep();
  byId("where").textContent = `Sweep ${state.at + 1} of ${seen.sweeps.length}`;
  byId("stamp").textContent = `${now.sensor} ${now.seq}, stamp ${seconds(now.stamp_ns)} s: `
    + `${now.points} points` + (now.every > 1 ? `, one in ${now.every} drawn (${now.kept})` : now.kept < now.points ? `, ${now.kept} drawn` : "");
  const known = truth();
  const bare = known && known.middles_ns[state.at] === null;
  byId("boxes-at").textContent = !known ? "Truth is switched off: only what a pipeline may see is drawn."
    : bare ? "The truth of this sweep is not there."
      : `True boxes: at the true time of the sweep's middle, ${seconds(known.middles_ns[state.at])} s.`;
}

function legend() {
  const gradient = byId("ramp"), byObject = state.colour === "object" && truth();
  gradient.hidden = Boolean(byObject);
  byId("by-object").hidden = !byObject;
  gradient.style.background = `linear-gradient(to right, ${look.ramp.join(", ")})`;
  const bright = state.colour === "intensity";
  byId("low").textContent = byObject ? "" : bright ? "intensity 0" : "height z 0 m and less";
  byId("high").textContent = byObject ? "" : bright ? "1" : `${look.height_m} m and more`;
  byId("dashed").hidden = !truth();
  byId("colour-object").disabled = !truth();
  byId("colour").value = byObject ? "object" : bright ? "intensity" : "height";
}

function draw() {
  slider.value = String(state.at);
  slider.setAttribute("aria-valuetext", `sweep ${state.at + 1}`);
  sayWhere();
  legend();
  drawEye();
  drawStrip();
  fillTable();
}

function go(at) {
  state.at = Math.min(seen.sweeps.length - 1, Math.max(0, at));
  remember();
  draw();
}

function remember() {
  const words = [`sweep=${state.at}`];
  if (!state.truth) words.push("truth=0");
  if (state.colour !== "object") words.push(`colour=${state.colour}`);
  try { history.replaceState(null, "", "#" + words.join("&")); } catch { /* an address that may not be changed */ }
}

function recall() {
  const told = new URLSearchParams(location.hash.slice(1));
  const at = Number.parseInt(told.get("sweep") ?? "0", 10);
  state.at = Math.min(seen.sweeps.length - 1, Math.max(0, Number.isFinite(at) ? at : 0));
  state.truth = told.get("truth") !== "0";
  state.colour = ["object", "intensity", "height"].includes(told.get("colour")) ? told.get("colour") : "object";
  byId("truth").checked = state.truth;
  draw();
}

function play(on) {
  state.playing = on;
  byId("play").textContent = on ? "Pause" : "Play";
  if (!on) return;
  const next = () => {
    if (!state.playing) return;
    if (state.at + 1 >= seen.sweeps.length) return play(false);
    go(state.at + 1);
    setTimeout(next, 200);
  };
  if (state.at + 1 >= seen.sweeps.length) go(0);
  setTimeout(next, 200);
}

slider.addEventListener("input", () => go(Number(slider.value)));
byId("play").addEventListener("click", () => play(!state.playing));
byId("truth").addEventListener("change", (event) => { state.truth = event.target.checked; remember(); draw(); });
byId("colour").addEventListener("change", (event) => { state.colour = event.target.value; remember(); draw(); });
byId("closer").addEventListener("click", () => zoom(0.8));
byId("wider").addEventListener("click", () => zoom(1.25));
byId("home").addEventListener("click", () => { resetEye(); drawEye(); });
window.addEventListener("hashchange", recall);
window.addEventListener("resize", draw);
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const on = event.target.tagName, ranged = event.target === slider;
  if (on === "SELECT" || (event.key === " " && (on === "BUTTON" || (on === "INPUT" && !ranged)))) return;
  const steps = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageDown: 10, PageUp: -10, Home: -1e9, End: 1e9 };
  if (event.key in steps) {
    const up = event.key === "ArrowUp" || event.key === "ArrowDown" || event.key.startsWith("Page") || event.key === "Home" || event.key === "End";
    if (up && !ranged) return;  // these scroll the page
    go(state.at + steps[event.key]);
  } else if (event.key === " ") play(!state.playing);
  else if (event.key === "t") byId("truth").click();
  else if (event.key === "+") zoom(0.8);
  else if (event.key === "-") zoom(1.25);
  else return;
  event.preventDefault();
});

resetEye();
recall();
