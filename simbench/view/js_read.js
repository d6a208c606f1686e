// The two blocks of data as typed arrays. What is true stays in `hidden`: nothing is drawn of it but through
// `truth()`, which is null while the switch is off.

const block = (id) => JSON.parse(document.getElementById(id).textContent);
const bytesOf = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const int16 = (text) => {
  const view = new DataView(bytesOf(text).buffer);
  return Int16Array.from({ length: view.byteLength / 2 }, (_, i) => view.getInt16(2 * i, true));
};

const look = block("look");
const seen = block("seen");
seen.xyz = int16(seen.xyz_cm);
seen.bright = bytesOf(seen.intensity);
let from = 0;
for (const sweep of seen.sweeps) {
  sweep.from = from;
  from += sweep.kept;
}

const hidden = block("hidden");
hidden.place = int16(hidden.places);
hidden.row = int16(hidden.points);
const NOWHERE = -32768;

const state = { at: 0, truth: true, colour: "object", playing: false };
const truth = () => (state.truth ? hidden : null);
const sweep = () => seen.sweeps[state.at];

// Every object has one colour on the whole page; targets come first.
const colours = (() => {
  const order = hidden.objects.map((_, i) => i);
  order.sort((a, b) => hidden.objects[b].target - hidden.objects[a].target || a - b);
  const found = [];
  order.forEach((row, i) => { found[row] = look.objects[i % look.objects.length]; });
  return found;
})();
const colourOf = (row) => (row >= 0 ? colours[row] : look.ground);

const signed = (ms) => (ms < 0 ? "−" : "+") + Math.abs(ms).toFixed(1);
const whole = (n) => (n < 0 ? "−" : "") + Math.abs(Math.round(n));
const seconds = (ns) => (ns * 1e-9).toFixed(4);

// A canvas as sharp as the screen, of a height per width; its context in CSS pixels.
function sized(canvas, height) {
  const ratio = window.devicePixelRatio || 1;
  const width = Math.max(1, canvas.clientWidth);
  const tall = Math.max(1, Math.round(height(width)));
  canvas.style.height = tall + "px";
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(tall * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(tall * ratio);
  }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, tall);
  return { ctx, width, height: tall };
}

// Puts words beside places; a word that would cover another one is left out.
function labels(ctx, width, height, font) {
  const taken = [];
  const free = (r) => r[0] >= 2 && r[1] >= 2 && r[2] <= width - 2 && r[3] <= height - 2
    && taken.every((t) => r[2] < t[0] || r[0] > t[2] || r[3] < t[1] || r[1] > t[3]);
  return {
    keep: (x0, y0, x1, y1) => taken.push([x0, y0, x1, y1]),
    // Beside (x, y), or above or below it, so far away; `beside` tries the sides first.
    put(text, x, y, [far, high], colour, beside) {
      ctx.font = font;
      const w = ctx.measureText(text).width, h = 13;
      const sides = [[x + far, y - h / 2], [x - far - w, y - h / 2]];
      const ends = [[x - w / 2, y - high - h], [x - w / 2, y + high]];
      for (const [left, top] of beside ? [...sides, ...ends] : [...ends, ...sides]) {
        const box = [left - 2, top, left + w + 2, top + h];
        if (!free(box)) continue;
        taken.push(box);
        ctx.textAlign = "left";
        ctx.textBaseline = "middle";
        ctx.lineWidth = 3;
        ctx.lineJoin = "round";
        ctx.strokeStyle = look.dark;
        ctx.strokeText(text, left, top + h / 2);
        ctx.fillStyle = colour;
        ctx.fillText(text, left, top + h / 2);
        return true;
      }
      return false;
    },
  };
}
