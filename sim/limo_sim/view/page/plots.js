// Plots of the run over time: a cursor reads the values, the wheel and the list zoom, a click goes to that time.
"use strict";

const LEFT = 38; // room for the numbers at the side, and for the times below [px]
const BOTTOM = 16;
let span = 60; // time that the plots show [s]
let cursor = null; // time under the pointer; null without one

// The plots end now, or show the timeline's instant with as much before as after it.
function shownTimes() {
  const all = Math.max(now.time, 10);
  const wide = Math.min(span, Math.max(all, 10));
  const end = past ? Math.min(Math.max(past[TIME] + wide / 2, wide), all) : Math.max(now.time, wide);
  return [end - wide, end];
}

const rowsShown = () => {
  const [begin, end] = shownTimes();
  return history.filter((row) => row[TIME] >= begin && row[TIME] <= end);
};

function zoom(seconds) {
  span = Math.max(seconds, 2);
  redraw();
}

function sheet(id) {
  const canvas = $(id);
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.lineJoin = pen.lineCap = "round";
  pen.font = "11px system-ui, sans-serif";
  return [pen, width, height];
}

function plot(id, series, low, high, bands = []) {
  const [pen, width, height] = sheet(id);
  const [begin, end] = shownTimes();
  const rows = rowsShown();
  const x = (t) => LEFT + ((t - begin) / (end - begin)) * (width - LEFT - 4);
  const y = (v) => 4 + ((high - v) / (high - low)) * (height - BOTTOM - 8);
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (let i = 0; i + 1 < bands.length; i++) {
    const [top, foot] = [y(Math.min(bands[i + 1], high)), y(bands[i])];
    pen.fillStyle = colours[`zone-${i}`];
    pen.fillRect(LEFT, top, width - LEFT - 4, foot - top);
    // The names go where there is room for them, clear of the line above and below.
    pen.fillStyle = colours.faint;
    if (foot - top > 13) pen.fillText(ZONES[i], width - 10, (top + foot) / 2);
  }
  pen.fillStyle = colours.faint;
  pen.lineWidth = 1;
  const step = nice((high - low) / 6);
  for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
    pen.strokeStyle = Math.abs(v) < step / 2 ? colours.faint : colours.line;
    line(pen, [[LEFT, y(v)], [width - 4, y(v)]]);
    pen.fillText(String(Number(v.toFixed(6))).replace("-", "−"), LEFT - 5, y(v));
  }
  pen.textAlign = "center";
  pen.textBaseline = "bottom";
  const tick = nice((end - begin) / 5);
  for (let t = Math.ceil(begin / tick) * tick; t <= end; t += tick) {
    pen.fillText(`${Number(t.toFixed(3))} s`, Math.min(Math.max(x(t), LEFT + 8), width - 14), height);
  }
  pen.lineWidth = 1.75;
  for (const [column, colour] of series) {
    pen.strokeStyle = colours[colour];
    let points = [];
    for (const row of rows) {
      if (row[column] === null) {
        line(pen, points);
        points = [];
      } else points.push([x(row[TIME]), y(row[column])]);
    }
    line(pen, points);
  }
  const at = cursor ?? (past && past[TIME]);
  if (at === null || at < begin || at > end || !rows.length) return;
  const row = nearest(rows, at);
  pen.strokeStyle = colours.ink;
  pen.lineWidth = 1;
  line(pen, [[x(row[TIME]), 4], [x(row[TIME]), height - BOTTOM]]);
  const words = [[`${row[TIME].toFixed(1)} s`, "ink"]];
  for (const [column, colour, unit] of series) {
    if (row[column] !== null) words.push([`${number(row[column], unit === "px" ? 0 : 2)} ${unit}`, colour]);
  }
  label(pen, words, x(row[TIME]), width);
}

// The values under the cursor, on the side where there is room.
function label(pen, words, x, width) {
  const wide = Math.max(...words.map(([text]) => pen.measureText(text).width)) + 12;
  const left = x + 8 + wide > width ? x - 8 - wide : x + 8;
  pen.fillStyle = colours.card;
  pen.globalAlpha = 0.9;
  pen.fillRect(left, 6, wide, 15 * words.length + 5);
  pen.globalAlpha = 1;
  pen.textAlign = "left";
  pen.textBaseline = "top";
  words.forEach(([text, colour], i) => {
    pen.fillStyle = colours[colour];
    pen.fillText(text, left + 6, 10 + 15 * i);
  });
}

function timeUnder(event) {
  const box = event.currentTarget.getBoundingClientRect();
  const [begin, end] = shownTimes();
  return begin + ((event.clientX - box.left - LEFT) / (box.width - LEFT - 4)) * (end - begin);
}

for (const canvas of document.querySelectorAll(".plots canvas")) {
  canvas.onpointermove = (event) => {
    cursor = timeUnder(event);
    redraw();
  };
  canvas.onpointerleave = () => {
    cursor = null;
    redraw();
  };
  canvas.onclick = (event) => goTo(timeUnder(event));
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(Math.min(span, Math.max(now.time, 10)) * (event.deltaY > 0 ? 1.25 : 0.8));
  }, { passive: false });
}

function nice(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= step);
}

function line(pen, points) {
  if (points.length < 2) return;
  pen.beginPath();
  for (const [x, y] of points) pen.lineTo(x, y);
  pen.stroke();
}
