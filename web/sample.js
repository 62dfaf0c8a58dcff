// A drawn street with people, the same at every visit.

// Parts of a person: ends and radius as shares of the height, x from the middle, y from the floor; and a colour.
const PARTS = [
  [-0.055, 0.03, -0.05, 0.27, 0.03, 2], [0.055, 0.03, 0.05, 0.27, 0.03, 2],
  [-0.05, 0.27, -0.04, 0.5, 0.043, 2], [0.05, 0.27, 0.04, 0.5, 0.043, 2],
  [-0.035, 0.52, 0.035, 0.52, 0.058, 2], [-0.135, 0.78, -0.16, 0.48, 0.026, 1],
  [0.135, 0.78, 0.16, 0.48, 0.026, 1], [-0.05, 0.6, -0.07, 0.76, 0.062, 1],
  [0.05, 0.6, 0.07, 0.76, 0.062, 1], [-0.1, 0.79, 0.1, 0.79, 0.038, 1],
  [0, 0.8, 0, 0.86, 0.028, 0], [0, 0.89, 0, 0.93, 0.052, 0],
];
// Middle and floor [px of 640 × 480], height [px], shirt and trousers.
const PEOPLE = [
  [150, 440, 330, "#28527a", "#20242c"], [330, 350, 190, "#7a2f2f", "#2b2b33"],
  [448, 322, 148, "#2f6b46", "#26262e"], [560, 398, 250, "#5a3b78", "#1e2128"],
];

/** Draws the street on a canvas of 640 × 480. */
export function street(context) {
  const sky = context.createLinearGradient(0, 0, 0, 480);
  sky.addColorStop(0, "#cfd8dc");
  sky.addColorStop(0.55, "#b7c0c4");
  sky.addColorStop(1, "#8d9599");
  context.fillStyle = sky;
  context.fillRect(0, 0, 640, 480);
  const houses = [
    [0, 40, 120, 215, "#b9b2a6"], [120, 90, 95, 165, "#a9b4b8"], [215, 20, 150, 235, "#c4b9a9"],
    [365, 110, 80, 145, "#b1aaa2"], [445, 55, 115, 200, "#bcc3bf"], [560, 95, 80, 160, "#aea79b"],
  ];
  for (const [x, y, width, height, colour] of houses) {
    context.fillStyle = colour;
    context.fillRect(x, y, width, height);
    context.fillStyle = "#8f989b";
    for (let row = y + 16; row < 225; row += 42) {
      for (let column = x + 12; column < x + width - 18; column += 34) context.fillRect(column, row, 15, 22);
    }
  }
  context.fillStyle = "#a5abae";
  context.fillRect(0, 255, 640, 225);
  for (const person of PEOPLE) draw(context, ...person);
}

function draw(context, middle, floor, height, shirt, trousers) {
  const colours = ["#c9a183", shirt, trousers];
  context.lineCap = "round";
  for (const [x0, y0, x1, y1, radius, colour] of PARTS) {
    context.strokeStyle = colours[colour];
    context.lineWidth = 2 * radius * height;
    context.beginPath();
    context.moveTo(middle + x0 * height, floor - y0 * height);
    context.lineTo(middle + x1 * height + 0.01, floor - y1 * height);
    context.stroke();
  }
}
