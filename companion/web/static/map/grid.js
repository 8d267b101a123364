// The background: range rings, the compass rose with its course marks, the wind.

import { courseText, rangeText, speedText, speedUnit } from "../core/units.js";
import { drawArrowHead } from "./symbols.js";

function drawRings({ pen, view, palette, settings }) {
  const spacing_m = view.ringSpacing_m(settings);
  const [x, y] = view.middle_px;
  const farthest_m = Math.hypot(x, y) / view.scale_pxpm;
  pen.lineWidth = 1;
  for (let range_m = spacing_m; range_m < farthest_m; range_m += spacing_m) {
    if (Math.abs(range_m - view.range_m) < 1) continue; // the rose is there
    pen.strokeStyle = range_m < view.range_m ? palette.grid : palette.faint;
    pen.beginPath();
    pen.arc(x, y, range_m * view.scale_pxpm, 0, 2 * Math.PI);
    pen.stroke();
  }
}

/** Ranges of the rings, to the lower right where the canvas is emptiest. */
export function drawRingLabels({ view, palette, settings, labels }) {
  const spacing_m = view.ringSpacing_m(settings);
  const [x, y] = view.middle_px;
  for (let range_m = spacing_m; range_m < view.range_m * 0.99; range_m += spacing_m) {
    const reach_px = range_m * view.scale_pxpm * Math.SQRT1_2;
    const text = rangeText(range_m, settings);
    labels.write(text, x + reach_px, y + reach_px, { colour: palette.quiet, size_px: 11 });
  }
}

function drawRose({ pen, view, palette, labels }) {
  const [x, y] = view.middle_px;
  const radius_px = view.radius_px;
  pen.strokeStyle = palette.grid;
  pen.lineWidth = 1.2;
  pen.beginPath();
  pen.arc(x, y, radius_px, 0, 2 * Math.PI);
  for (let course_deg = 0; course_deg < 360; course_deg += 10) {
    const length_px = course_deg % 30 === 0 ? 9 : 5;
    pen.moveTo(...view.along([x, y], course_deg, radius_px));
    pen.lineTo(...view.along([x, y], course_deg, radius_px - length_px));
  }
  pen.stroke();
  for (let course_deg = 0; course_deg < 360; course_deg += 30) {
    const text = { 0: "N", 90: "E", 180: "S", 270: "W" }[course_deg] ?? courseText(course_deg);
    const cardinal = text.length === 1;
    labels.write(text, ...view.along([x, y], course_deg, radius_px + 12), {
      colour: cardinal ? palette.ink : palette.quiet, size_px: cardinal ? 13 : 11, weight: cardinal ? 700 : 500,
    });
  }
}

/** A mark on the rose: filled for our course, larger and hollow for the commanded one. */
function drawCourseMark({ pen, view }, course_deg, colour, filled) {
  const [length_px, half_px] = filled ? [12, 6] : [18, 11];
  const tip = view.along(view.middle_px, course_deg, view.radius_px + (filled ? -2 : 1));
  pen.save();
  pen.translate(...tip);
  pen.rotate(view.angle(course_deg));
  pen.beginPath();
  pen.moveTo(0, 0);
  pen.lineTo(-length_px, -half_px);
  pen.lineTo(-length_px, half_px);
  pen.closePath();
  pen.lineWidth = 2;
  pen.strokeStyle = pen.fillStyle = colour;
  if (filled) pen.fill();
  pen.stroke();
  pen.restore();
}

function drawCourses(frame) {
  const { state, palette } = frame;
  const commanded_deg = state.decision.guidance?.course_deg ?? null;
  if (commanded_deg !== null) drawCourseMark(frame, commanded_deg, palette.commanded, false);
  const course_deg = state.own?.course_deg ?? null;
  if (course_deg !== null) drawCourseMark(frame, course_deg, palette.own, true);
}

/** An arrow that points where the wind blows to, and the wind in words as pilots give it: from where. */
export function drawWind({ pen, view, palette, settings, state, labels }) {
  const north_mps = state.own?.wind_north_mps ?? null;
  const east_mps = state.own?.wind_east_mps ?? null;
  if (north_mps === null || east_mps === null) return;
  const to_deg = (Math.atan2(east_mps, north_mps) * 180) / Math.PI;
  const x = 30;
  const y = view.height_px - 44;
  const tail = view.along([x, y], to_deg + 180, 13);
  const tip = view.along([x, y], to_deg, 13);
  pen.strokeStyle = palette.quiet;
  pen.lineWidth = 2;
  pen.beginPath();
  pen.moveTo(...tail);
  pen.lineTo(...tip);
  pen.stroke();
  drawArrowHead(pen, tip, view.angle(to_deg), 8);
  const speed = `${speedText(Math.hypot(north_mps, east_mps), settings)} ${speedUnit(settings)}`;
  const style = { colour: palette.quiet, size_px: 11, align: "left" };
  labels.write(`${courseText(to_deg + 180)} / ${speed}`, 12, view.height_px - 18, style);
}

export function drawGrid(frame) {
  drawRings(frame);
  drawRose(frame);
  drawCourses(frame);
}
