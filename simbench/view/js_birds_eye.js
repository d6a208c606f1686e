// The bird's-eye view in the ego frame: x, forward, is up; y, left, is left.

const eye = { canvas: document.getElementById("eye"), x: 0, y: 0, mpp: 0, half: 0 };

function resetEye() {
  const far = [];
  for (let i = 0; i < seen.sweeps[0].kept; i += 1) far.push(Math.hypot(seen.xyz[3 * i], seen.xyz[3 * i + 1]) / 100);
  far.sort((a, b) => a - b);
  const usual = far.length ? far[Math.floor(0.9 * (far.length - 1))] : 30;
  eye.x = 0;
  eye.y = 0;
  eye.half = Math.min(60, Math.max(15, usual));
  eye.mpp = 0;
}

const ramp = (share) => look.ramp[Math.min(look.ramp.length - 1, Math.max(0, Math.floor(share * look.ramp.length)))];

// A colour per point, by what is chosen; without truth there are no objects to colour by.
function pointColour(known) {
  if (state.colour === "intensity") return (i) => ramp(Math.pow(seen.bright[i] / 255, 0.6));
  if (state.colour === "object" && known) return (i) => colourOf(known.row[i]);
  return (i) => ramp(seen.xyz[3 * i + 2] / 100 / look.height_m);
}

function drawEye() {
  const { ctx, width, height } = sized(eye.canvas, () => look.eye_px);
  if (!eye.mpp) eye.mpp = (2 * eye.half) / height;
  const X = (y) => width / 2 - (y - eye.y) / eye.mpp;
  const Y = (x) => height / 2 - (x - eye.x) / eye.mpp;
  ctx.fillStyle = look.dark;
  ctx.fillRect(0, 0, width, height);
  const words = labels(ctx, width, height, "12px system-ui, 'DejaVu Sans', sans-serif");
  words.keep(0, 0, 46, height);  // the numbers of the axes
  words.keep(0, height - 22, width, height);
  grid(ctx, width, height, X, Y);

  const known = truth();
  const now = sweep(), colour = pointColour(known), byColour = new Map();
  for (let i = now.from; i < now.from + now.kept; i += 1) {
    const c = colour(i);
    if (!byColour.has(c)) byColour.set(c, []);
    byColour.get(c).push(i);
  }
  const dot = Math.min(3, Math.max(1.5, 0.12 / eye.mpp));
  for (const [c, points] of byColour) {
    ctx.fillStyle = c;
    for (const i of points) {
      ctx.fillRect(X(seen.xyz[3 * i + 1] / 100) - dot / 2, Y(seen.xyz[3 * i] / 100) - dot / 2, dot, dot);
    }
  }
  ctx.strokeStyle = "#fff";  // the ego
  ctx.lineWidth = 1.5;
  ctx.beginPath();
  ctx.moveTo(X(0), Y(0) - 9);
  ctx.lineTo(X(0) - 6, Y(0) + 6);
  ctx.lineTo(X(0) + 6, Y(0) + 6);
  ctx.closePath();
  ctx.stroke();
  words.keep(X(0) - 8, Y(0) - 10, X(0) + 8, Y(0) + 8);
  if (known) drawBoxes(ctx, words, known, X, Y);
}

function grid(ctx, width, height, X, Y) {
  const step = [1, 2, 5, 10, 20, 50, 100, 200].find((s) => s / eye.mpp >= 48) || 500;
  ctx.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  ctx.fillStyle = look.soft;
  ctx.lineWidth = 1;
  const line = (zero, x0, y0, x1, y1) => {
    ctx.strokeStyle = zero ? look.soft : look.grid;
    ctx.beginPath();
    ctx.moveTo(x0, y0);
    ctx.lineTo(x1, y1);
    ctx.stroke();
  };
  const x0 = eye.x - (height / 2) * eye.mpp, x1 = eye.x + (height / 2) * eye.mpp;
  const y0 = eye.y - (width / 2) * eye.mpp, y1 = eye.y + (width / 2) * eye.mpp;
  ctx.textBaseline = "middle";
  ctx.textAlign = "right";
  for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) {
    line(x === 0, 46, Y(x), width, Y(x));
    if (Y(x) > 26 && Y(x) < height - 34) ctx.fillText(whole(x), 42, Y(x));
  }
  ctx.textAlign = "center";
  for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
    line(y === 0, X(y), 0, X(y), height - 22);
    if (X(y) > 64 && X(y) < width - 74) ctx.fillText(whole(y), X(y), height - 10);
  }
  ctx.fillStyle = "#fff";
  ctx.textAlign = "left";
  ctx.fillText("x forward [m]", 6, 11);
  ctx.textAlign = "right";
  ctx.fillText("y left [m]", width - 6, height - 10);
}

function drawBoxes(ctx, words, known, X, Y) {
  const many = known.objects.length;
  const shown = known.objects.map((object, row) => {
    const at = 3 * (state.at * many + row);
    const [x, y, yaw] = [known.place[at] / 100, known.place[at + 1] / 100, known.place[at + 2] / 1e4];
    return { object, row, x, y, yaw, there: known.place[at] !== NOWHERE };
  }).filter((b) => b.there);
  shown.sort((a, b) => a.object.target - b.object.target || Math.hypot(b.x, b.y) - Math.hypot(a.x, a.y));
  for (const b of shown) {
    const [l, w] = [b.object.size_m[0] / 2, b.object.size_m[1] / 2];
    const c = Math.cos(b.yaw), s = Math.sin(b.yaw);
    const corner = (f, g) => [X(b.y + s * f * l + c * g * w), Y(b.x + c * f * l - s * g * w)];
    ctx.strokeStyle = colourOf(b.row);
    ctx.lineWidth = b.object.target ? 2.5 : 1.3;
    ctx.beginPath();
    [[1, 1], [-1, 1], [-1, -1], [1, -1]].forEach(([f, g], i) => (i ? ctx.lineTo(...corner(f, g)) : ctx.moveTo(...corner(f, g))));
    ctx.closePath();
    const nose = Math.max(l, 8 * eye.mpp) + 6 * eye.mpp;  // a heading that is seen, however small the box is
    ctx.moveTo(X(b.y), Y(b.x));
    ctx.lineTo(X(b.y + s * nose), Y(b.x + c * nose));
    ctx.stroke();
  }
  for (const b of [...shown].reverse()) {
    const gap = Math.min(60, Math.max(7, Math.hypot(b.object.size_m[0], b.object.size_m[1]) / 2 / eye.mpp * 0.75));
    words.put(b.object.name + (b.object.target ? " (target)" : ""), X(b.y), Y(b.x), [gap, gap], colourOf(b.row), true);
  }
  eye.boxes = shown.map((b) => ({ ...b, px: X(b.y), py: Y(b.x) }));
}

// The name of what the pointer is on.
function under(event) {
  const known = truth();
  const at = known ? (eye.boxes || []).map((b) => [Math.hypot(b.px - event.offsetX, b.py - event.offsetY), b]) : [];
  at.sort((a, b) => a[0] - b[0]);
  const near = at.length && at[0][0] < Math.max(8, at[0][1].object.size_m[0] / 2 / eye.mpp) ? at[0][1] : null;
  eye.canvas.title = near
    ? `${near.object.name} (${near.object.category}), ${near.object.size_m.map((v) => v.toFixed(2)).join(" × ")} m, `
      + `x ${near.x.toFixed(2)} m, y ${near.y.toFixed(2)} m, heading ${(near.yaw * 180 / Math.PI).toFixed(1)}°`
    : "";
}

function zoom(factor) {
  eye.mpp = Math.min(1, Math.max(0.005, eye.mpp * factor));
  drawEye();
}

eye.canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(event.deltaY * 0.001));
}, { passive: false });
eye.canvas.addEventListener("pointermove", (event) => {
  if (!(event.buttons & 1)) return under(event);
  eye.y += event.movementX * eye.mpp;
  eye.x += event.movementY * eye.mpp;
  drawEye();
});
eye.canvas.addEventListener("pointerdown", (event) => eye.canvas.setPointerCapture(event.pointerId));
