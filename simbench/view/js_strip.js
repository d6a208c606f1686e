// The cameras: what of each had been delivered when the sweep was, and when it was taken, beside the sweep.

const tag = (name, klass, parent) => {
  const made = document.createElement(name);
  if (klass) made.className = klass;
  if (parent) parent.append(made);
  return made;
};

const strip = document.getElementById("strip");
const cells = seen.cameras.map((camera, index) => {
  const cell = tag("figure", "cell", strip);
  const head = tag("div", "head", cell);
  tag("b", "", head).textContent = camera.name;
  const note = tag("span", "", head);
  const picture = tag("canvas", "", cell);
  const bar = tag("canvas", "bar", cell);
  const times = tag("div", "times", cell);
  picture.setAttribute("role", "img");
  return { camera, index, note, picture, bar, times };
});

const pictures = new Map();
function pictureOf(place) {
  const jpeg = seen.messages[place].jpeg;
  if (!jpeg) return null;
  if (!pictures.has(place)) {
    const image = new Image();
    image.onload = () => drawStrip();
    image.src = "data:image/jpeg;base64," + jpeg;
    pictures.set(place, image);
  }
  const image = pictures.get(place);
  return image.complete && image.naturalWidth ? image : null;
}

// The scale of the bars: the sweep, and half a period beyond what is shown of any image.
const span = (() => {
  const last = Math.max(1e6, ...seen.sweeps.map((s) => s.last_ns));
  let low = 0, high = last;
  seen.sweeps.forEach((now, i) => {
    for (const of of [...seen.images, ...seen.boxes]) {
      if (of[i] < 0) continue;
      const after = seen.messages[of[i]].stamp_ns - now.stamp_ns;
      low = Math.min(low, after);
      high = Math.max(high, after);
    }
  });
  return [Math.max(low, -4 * last) - 0.5 * last, Math.min(high, 4 * last) + 0.5 * last];
})();

function drawStrip() {
  const known = truth();
  for (const cell of cells) {
    const image = seen.images[cell.index][state.at], boxes = seen.boxes[cell.index][state.at];
    const place = image >= 0 ? image : boxes;
    const taken = known && place >= 0 ? known.taken[place] : null;
    drawPicture(cell, image, boxes, taken);
    drawBar(cell, place, taken, known ? known.starts_ns[state.at] ?? sweep().stamp_ns : null);
  }
}

const counted = (boxes) => (boxes === 1 ? "1 box" : `${boxes} boxes`);

function drawPicture(cell, image, boxes, taken) {
  const { width_px: wide, height_px: tall, azimuth_deg: azimuth } = cell.camera;
  const { ctx, width, height } = sized(cell.picture, (w) => Math.min(2 * w, (w * tall) / wide));
  const scale = Math.min(width / wide, height / tall);
  ctx.fillStyle = look.plain;
  ctx.fillRect(0, 0, width, height);
  const shot = image >= 0 ? pictureOf(image) : null;
  if (shot) ctx.drawImage(shot, 0, 0, wide * scale, tall * scale);
  const words = labels(ctx, width, height, "12px system-ui, 'DejaVu Sans', sans-serif");
  const found = boxes >= 0 ? seen.messages[boxes] : { boxes: [], more: 0 };
  const area = (b) => (b[4] - b[2]) * (b[5] - b[3]);
  for (const [, , x0, y0, x1, y1] of found.boxes) {
    ctx.lineWidth = 3.4;
    ctx.strokeStyle = "rgba(0, 0, 0, 0.55)";
    ctx.strokeRect(x0 * scale, y0 * scale, (x1 - x0) * scale, (y1 - y0) * scale);
    ctx.lineWidth = 1.4;
    ctx.strokeStyle = "#fff";
    ctx.strokeRect(x0 * scale, y0 * scale, (x1 - x0) * scale, (y1 - y0) * scale);
  }
  if (taken) {
    ctx.setLineDash([4, 4]);
    ctx.lineWidth = 1.8;
    for (const [row, x0, y0, x1, y1] of taken.boxes) {
      ctx.strokeStyle = colourOf(row);
      ctx.strokeRect(x0 * scale, y0 * scale, (x1 - x0) * scale, (y1 - y0) * scale);
    }
    ctx.setLineDash([]);
  }
  for (const b of [...found.boxes].sort((p, q) => area(q) - area(p))) {
    const [track, category, x0, y0, x1, y1] = b;
    const reach = [((x1 - x0) / 2) * scale + 3, ((y1 - y0) / 2) * scale + 3];
    words.put(`${category} ${track}`, ((x0 + x1) / 2) * scale, ((y0 + y1) / 2) * scale, reach, "#fff", false);
  }
  const said = [`looks ${Math.abs(azimuth).toFixed(0)}°${azimuth > 0.5 && azimuth < 179.5 ? " left" : azimuth < -0.5 && azimuth > -179.5 ? " right" : ""}`];
  if (image >= 0) said.push(`image ${seen.messages[image].seq}` + (seen.messages[image].jpeg ? "" : ", not on this page"));
  if (boxes >= 0) said.push(counted(found.boxes.length + found.more) + (image >= 0 && found.seq !== seen.messages[image].seq ? ` of image ${found.seq}` : ""));
  if (image < 0 && boxes < 0) said.push("nothing delivered yet");
  cell.note.textContent = said.join(", ");
  cell.picture.setAttribute("aria-label", `${cell.camera.name}: ${said.join(", ")}`);
}

function drawBar(cell, place, taken, start) {
  const { ctx, width, height } = sized(cell.bar, () => 34);
  const now = sweep(), [low, high] = span;
  const at = (ns) => 4 + ((width - 8) * (Math.min(high, Math.max(low, ns)) - low)) / (high - low);
  ctx.fillStyle = look.dark;
  ctx.fillRect(0, 0, width, height);
  ctx.fillStyle = look.plain;
  ctx.fillRect(at(0), 11, at(now.last_ns) - at(0), 8);
  ctx.font = "11px system-ui, 'DejaVu Sans', sans-serif";
  ctx.fillStyle = look.soft;
  ctx.textBaseline = "bottom";
  ctx.textAlign = "center";
  const step = [10e6, 20e6, 50e6, 100e6, 200e6, 500e6, 1e9].find((s) => (s * (width - 8)) / (high - low) > 44) || 2e9;
  for (let t = Math.ceil(low / step) * step; t <= high; t += step) {
    ctx.fillRect(at(t), 19, 1, 3);
    if (at(t) > 14 && at(t) < width - 14) ctx.fillText(whole(t / 1e6), at(t), height - 1);
  }
  const said = [];
  const passes = now.passes_ms[cell.index];
  if (passes !== null) {
    ctx.fillStyle = look.beam;
    ctx.fillRect(at(passes * 1e6) - 1.5, 9, 3, 12);
    said.push(["beam", "▮", `LiDAR looks there ${signed(passes)}`]);
  }
  if (place >= 0) {
    const after = seen.messages[place].stamp_ns - now.stamp_ns;
    ctx.fillStyle = "#fff";
    ctx.beginPath();
    ctx.moveTo(at(after) - 5, 1);
    ctx.lineTo(at(after) + 5, 1);
    ctx.lineTo(at(after), 11);
    ctx.fill();
    said.push(["stamp", "▼", `stamp ${signed(after / 1e6)}`]);
    if (taken) {
      const late = taken.capture_ns - start;
      ctx.strokeStyle = look.shift;
      ctx.lineWidth = 2;
      ctx.beginPath();
      ctx.arc(at(late), 15, 4.5, 0, 2 * Math.PI);
      ctx.stroke();
      const own = (taken.capture_ns - seen.messages[place].stamp_ns) / 1e6;
      said.push(["taken", "○", `truly taken ${signed(late / 1e6)} (${signed(own)} to its stamp)`]);
    }
  }
  cell.times.replaceChildren(...said.map(([klass, mark, text]) => {
    const word = tag("span", klass);
    tag("i", "", word).textContent = mark;
    word.append(" " + text);
    return word;
  }));
}
