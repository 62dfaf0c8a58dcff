// The lesson's pictures: each draws what one step of the method makes of a window.

export const BINS = 9;
const CELL = 8;

/** The colour of an orientation bin: hues go once round over 180°. */
export const hue = (bin) => `hsl(${(bin * 360) / BINS} 75% 55%)`;

/** Sums of each cell's votes: `columns × rows` lists of nine numbers, row by row. */
export function cells(votes, width, height) {
  const columns = width / CELL;
  const sums = Array.from({ length: columns * (height / CELL) }, () => new Float64Array(BINS));
  for (let i = 0; i < width * height; i++) {
    const x = i % width, y = Math.floor(i / width);
    const sum = sums[Math.floor(y / CELL) * columns + Math.floor(x / CELL)];
    sum[votes[4 * i + 2]] += votes[4 * i];
    sum[votes[4 * i + 3]] += votes[4 * i + 1];
  }
  return sums;
}

/** The gradient: bright where it is long, its colour the orientation. */
export function drawGradient(canvas, votes, width, height) {
  size(canvas, width, height);
  const context = canvas.getContext("2d");
  const lengths = Array.from({ length: width * height }, (_, i) => votes[4 * i] + votes[4 * i + 1]);
  const most = Math.max(...lengths, 1);
  lengths.forEach((length, i) => {
    const bin = votes[4 * i + (votes[4 * i] >= votes[4 * i + 1] ? 2 : 3)];
    context.fillStyle = `hsl(${(bin * 360) / BINS} 75% ${Math.min(70, (length / most) * 110)}%)`;
    context.fillRect(i % width, Math.floor(i / width), 1, 1);
  });
}

/** The cells as stars: a line along the edge of each bin, as bright as the bin is high. */
export function drawCells(canvas, sums, width, height, chosen) {
  const grain = 6; // canvas pixels to a pixel of the window
  size(canvas, width * grain, height * grain);
  const context = canvas.getContext("2d");
  context.fillStyle = "#101418";
  context.fillRect(0, 0, canvas.width, canvas.height);
  const columns = width / CELL, side = CELL * grain;
  const most = Math.max(...sums.flatMap((sum) => Array.from(sum)), 1);
  context.lineWidth = 4;
  context.lineCap = "round";
  sums.forEach((sum, cell) => {
    const x = ((cell % columns) + 0.5) * side, y = (Math.floor(cell / columns) + 0.5) * side;
    sum.forEach((value, bin) => {
      const angle = ((bin + 0.5) / BINS) * Math.PI + Math.PI / 2;
      const [dx, dy] = [Math.cos(angle) * side * 0.42, Math.sin(angle) * side * 0.42];
      context.globalAlpha = Math.min(1, (1.6 * value) / most);
      context.strokeStyle = hue(bin);
      context.beginPath();
      context.moveTo(x - dx, y - dy);
      context.lineTo(x + dx, y + dy);
      context.stroke();
    });
  });
  context.globalAlpha = 1;
  frame(context, (chosen % columns) * side, Math.floor(chosen / columns) * side, side, side, "#fff");
}

/** What each block of the descriptor adds to the margin, row by row. */
export function shares(descriptor, weights, width, height) {
  const columns = width / CELL - 1, rows = height / CELL - 1;
  return Array.from({ length: columns * rows }, (_, block) => {
    // The descriptor lists blocks column by column.
    const first = ((block % columns) * rows + Math.floor(block / columns)) * 4 * BINS;
    let sum = 0;
    for (let i = first; i < first + 4 * BINS; i++) sum += descriptor[i] * weights[i];
    return sum;
  });
}

/** The blocks' shares: green speaks for a person, red against. */
export function drawShares(canvas, values, width, height, chosen) {
  const side = 48, columns = width / CELL - 1, rows = height / CELL - 1;
  size(canvas, columns * side, rows * side);
  const context = canvas.getContext("2d");
  const most = Math.max(...values.map(Math.abs), 1e-9);
  values.forEach((value, block) => {
    const x = (block % columns) * side, y = Math.floor(block / columns) * side;
    const strength = Math.round((Math.abs(value) / most) * 100);
    context.fillStyle = "#101418";
    context.fillRect(x, y, side, side);
    context.fillStyle = `hsl(${value > 0 ? 150 : 12} 70% 50% / ${strength}%)`;
    context.fillRect(x + 1, y + 1, side - 2, side - 2);
    context.fillStyle = "#fff";
    context.font = "600 22px system-ui, sans-serif";
    context.textAlign = "center";
    if (strength > 25) context.fillText(value > 0 ? "+" : "−", x + side / 2, y + side / 2 + 8);
  });
  frame(context, (chosen % columns) * side, Math.floor(chosen / columns) * side, side, side, "#fff");
}

/** The picture at levels some way apart, from left to right, with the window on each: always of the same size. */
export function drawPyramid(canvas, source, scale, model) {
  const [wide, gap] = [900, 10];
  const factors = [];
  for (let factor = 1; factors.length < 64; factor *= scale) {
    if (source.width / factor < model.width || source.height / factor < model.height) break;
    factors.push(factor);
  }
  const apart = Math.max(1, Math.round(Math.log(1.4) / Math.log(scale)));
  const shown = factors.filter((_, level) => level % apart === 0);
  const widths = shown.reduce((sum, factor) => sum + source.width / factor, 0);
  const share = (wide - gap * (shown.length - 1)) / (widths || source.width);
  size(canvas, wide, source.height * share);
  const context = canvas.getContext("2d");
  let x = 0;
  for (const factor of shown) {
    const [width, height] = [source.width, source.height].map((side) => (side / factor) * share);
    context.drawImage(source, x, canvas.height - height, width, height);
    frame(context, x + 2, canvas.height - model.height * share - 2, model.width * share, model.height * share, "#ff8a50");
    x += width + gap;
  }
  return factors.length;
}

/** Rectangles on a picture. */
export function drawRects(canvas, source, rects, chosen = -1, alpha = 1) {
  size(canvas, source.width, source.height);
  const context = canvas.getContext("2d");
  context.drawImage(source, 0, 0);
  context.globalAlpha = alpha;
  rects.forEach(({ x, y, width, height }) => frame(context, x, y, width, height, "#ff7043"));
  context.globalAlpha = 1;
  const { x, y, width, height } = rects[chosen] ?? {};
  if (width) frame(context, x, y, width, height, "#ffd54f", 5);
}

function frame(context, x, y, width, height, colour, line = 3) {
  context.lineWidth = line + 2;
  context.strokeStyle = "#0008";
  context.strokeRect(x, y, width, height);
  context.lineWidth = line;
  context.strokeStyle = colour;
  context.strokeRect(x, y, width, height);
}

function size(canvas, width, height) {
  canvas.width = width;
  canvas.height = height;
}
