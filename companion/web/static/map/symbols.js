// Symbols as on TCAS and CDTI. Each level has a shape of its own: colour is never the only sign.

import { FONT } from "../core/palette.js";

const SIZE_PX = { other: 7, proximate: 7, caution: 7.5, warning: 7.5 };

function outline(pen, level, size_px) {
  pen.beginPath();
  if (level === "warning") pen.rect(-size_px, -size_px, 2 * size_px, 2 * size_px);
  else if (level === "caution") pen.arc(0, 0, size_px, 0, 2 * Math.PI);
  else {
    pen.moveTo(0, -size_px);
    pen.lineTo(size_px, 0);
    pen.lineTo(0, size_px);
    pen.lineTo(-size_px, 0);
    pen.closePath();
  }
}

/** A track: hollow or filled diamond, circle, square; hollow and dashed when it is coasted, thin when tentative. */
export function drawTraffic(pen, [x, y], level, { colour, fill, ground, coasted, tentative }) {
  pen.save();
  pen.translate(x, y);
  outline(pen, level, SIZE_PX[level] + 1.5);
  pen.fillStyle = ground; // separates the symbol from the lines beneath
  pen.fill();
  outline(pen, level, SIZE_PX[level]);
  pen.lineWidth = tentative ? 1.1 : 1.8;
  pen.strokeStyle = colour;
  pen.fillStyle = fill;
  if (coasted) pen.setLineDash([2.5, 2.5]);
  else if (level !== "other") pen.fill();
  pen.stroke();
  pen.restore();
}

/** An aircraft that is known of, but has no track: a question mark in a dotted circle. */
export function drawUnknown(pen, [x, y], colour, ground) {
  pen.save();
  pen.beginPath();
  pen.arc(x, y, 8, 0, 2 * Math.PI);
  pen.fillStyle = ground;
  pen.fill();
  pen.setLineDash([2, 2]);
  pen.lineWidth = 1.4;
  pen.strokeStyle = pen.fillStyle = colour;
  pen.stroke();
  pen.font = `700 12px ${FONT}`;
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  pen.fillText("?", x, y + 0.5);
  pen.restore();
}

/** An obstacle on the ground: the mast symbol of charts. */
export function drawObstacle(pen, [x, y], level, style) {
  const alarming = level === "caution" || level === "warning";
  if (alarming) drawTraffic(pen, [x, y], level, style);
  pen.save();
  pen.translate(x, y);
  pen.beginPath();
  pen.moveTo(-6, 6);
  pen.lineTo(0, -8);
  pen.lineTo(6, 6);
  pen.strokeStyle = alarming ? style.ground : style.colour;
  pen.lineWidth = 1.6;
  pen.stroke();
  pen.beginPath();
  pen.arc(0, 4.5, 1.4, 0, 2 * Math.PI);
  pen.fillStyle = pen.strokeStyle;
  pen.fill();
  pen.restore();
}

/** Our aircraft; `angle` is that of its heading. */
export function drawOwn(pen, [x, y], angle, colour, ground) {
  const draw = (width_px, style) => {
    pen.lineWidth = width_px;
    pen.strokeStyle = style;
    pen.beginPath();
    for (const [fromX, fromY, toX, toY] of [[0, -13, 0, 12], [-13, -2, 13, -2], [-5.5, 10, 5.5, 10]]) {
      pen.moveTo(fromX, fromY);
      pen.lineTo(toX, toY);
    }
    pen.stroke();
  };
  pen.save();
  pen.translate(x, y);
  pen.rotate(angle + Math.PI / 2);
  pen.lineCap = "round";
  draw(6, ground);
  draw(2.8, colour);
  pen.restore();
}

/** Brackets around the selected aircraft. */
export function drawSelection(pen, [x, y], colour) {
  const far = 15;
  const near = 8;
  pen.beginPath();
  for (const [sideX, sideY] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
    pen.moveTo(x + sideX * far, y + sideY * near);
    pen.lineTo(x + sideX * far, y + sideY * far);
    pen.lineTo(x + sideX * near, y + sideY * far);
  }
  pen.strokeStyle = colour;
  pen.lineWidth = 1.8;
  pen.stroke();
}

/** The arrow beside a relative height: a climb or descent of more than 500 ft/min. */
export function drawClimbArrow(pen, x, y, up, colour) {
  const tip = up ? -5.5 : 5.5;
  pen.beginPath();
  pen.moveTo(x, y - tip);
  pen.lineTo(x, y + tip);
  pen.moveTo(x - 3, y + tip * 0.35);
  pen.lineTo(x, y + tip);
  pen.lineTo(x + 3, y + tip * 0.35);
  pen.strokeStyle = colour;
  pen.lineWidth = 1.6;
  pen.stroke();
}

export function drawArrowHead(pen, [x, y], angle, size_px) {
  pen.save();
  pen.translate(x, y);
  pen.rotate(angle);
  pen.beginPath();
  pen.moveTo(-size_px, -size_px * 0.6);
  pen.lineTo(0, 0);
  pen.lineTo(-size_px, size_px * 0.6);
  pen.stroke();
  pen.restore();
}
