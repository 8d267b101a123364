// The map around our aircraft: order of drawing, range, and input by finger and mouse.

import { fitCanvas } from "../core/dom.js";
import { readPalette } from "../core/palette.js";
import { drawGrid, drawRingLabels, drawWind } from "./grid.js";
import { Labels } from "./labels.js";
import { drawPlan } from "./plan.js";
import { drawOwn, drawSelection } from "./symbols.js";
import { drawThreats } from "./threat.js";
import { drawAllTraffic, drawConcerns, drawOffCanvas, drawTrend, pick, placesOf, wantedRange_m } from "./traffic.js";
import { rangeSteps_m, View } from "./view.js";

const TOUCH_PX = 26;
const WHEEL_STEP = 90; // sum of wheel deltas for one step of range
const DENSE = 40; // aircraft; with more, labels are smaller

export class Scope {
  /** Calls `redraw()` when a new drawing is needed, `onSelect(key)` when an aircraft is tapped. */
  constructor(canvas, settings, { redraw, onSelect }) {
    Object.assign(this, { canvas, settings, redraw, onSelect });
    this.pen = canvas.getContext("2d", { alpha: false });
    this.view = new View();
    this.view.range_m = settings.range_m;
    this.labels = new Labels();
    this.palette = readPalette();
    this.tracksDrawn = 0;
    this.places = new Map();
    this.ownPlace = null;
    this.fingers = new Map();
    this.wheel = 0;
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.listen();
  }

  resize() {
    const { box, ratio } = fitCanvas(this.canvas);
    this.ratio = ratio;
    this.view.width_px = box.width;
    this.view.height_px = box.height;
    this.corners = [...this.canvas.parentElement.querySelectorAll(".corner")].map((each) => {
      const { x, y, width, height } = each.getBoundingClientRect();
      return [x - box.x, y - box.y, width, height];
    });
    this.redraw();
  }

  readColours() {
    this.palette = readPalette();
  }

  /** Draws a state; `follow` is the key of the track in the middle, null for our aircraft. */
  draw(state, { ordered, selected, follow, flown }) {
    this.fitRange(state);
    this.turn(state, follow);
    const { pen, view, palette, settings, labels } = this;
    this.places = placesOf(state, view);
    this.ownPlace = state.own === null ? null : view.place([0, 0]);
    pen.setTransform(this.ratio ?? 1, 0, 0, this.ratio ?? 1, 0, 0);
    pen.fillStyle = palette.ground;
    pen.fillRect(0, 0, view.width_px, view.height_px);
    labels.clear(pen, palette.ground, view);
    for (const corner of this.corners ?? []) labels.take(...corner); // covered by buttons
    const dense = ordered.length > DENSE;
    const frame = {
      pen, view, palette, settings, labels, state, ordered, selected, flown, dense, own: state.own, places: this.places,
    };
    drawGrid(frame);
    drawPlan(frame);
    drawThreats(frame);
    drawRingLabels(frame);
    this.drawOwnship(frame);
    this.tracksDrawn = drawAllTraffic(frame);
    drawConcerns(frame);
    drawOffCanvas(frame);
    drawWind(frame);
  }

  drawOwnship({ pen, palette, state, labels, selected }) {
    if (this.ownPlace === null) return;
    const { own } = state;
    if (state.predicted.length === 0) this.drawOwnTrend(own);
    const nose_deg = own.heading_deg ?? own.course_deg ?? 0;
    drawOwn(pen, this.ownPlace, this.view.angle(nose_deg), palette.own, palette.ground);
    labels.take(this.ownPlace[0] - 13, this.ownPlace[1] - 13, 26, 26);
    if (selected === "own") drawSelection(pen, this.ownPlace, palette.ink);
  }

  /** The trend vector of our aircraft, for states without a predicted path. */
  drawOwnTrend(own) {
    drawTrend(this, this.ownPlace, { ...own, turn_dps: 0 }, this.palette.own);
  }

  turn(state, follow) {
    const { own } = state;
    this.view.up_deg = this.settings.orientation === "track" ? (own?.course_deg ?? 0) : 0;
    const track = state.tracks.find((each) => each.track === follow);
    const known = own !== null && track !== undefined && track.north_m !== null && track.east_m !== null;
    this.view.middle_m = known ? [track.north_m - own.north_m, track.east_m - own.east_m] : [0, 0];
  }

  /** Automatic range: farther at once, nearer only with plenty of room, so that it does not oscillate. */
  fitRange(state) {
    if (!this.settings.autoRange || state.own === null) return;
    const wanted_m = wantedRange_m(state);
    const steps_m = rangeSteps_m(this.settings);
    const fitting_m = steps_m.find((step_m) => step_m >= wanted_m) ?? steps_m.at(-1);
    const roomy_m = steps_m.find((step_m) => step_m >= wanted_m * 1.25) ?? steps_m.at(-1);
    if (this.view.range_m < wanted_m) this.view.range_m = fitting_m;
    else if (this.view.range_m > roomy_m) this.view.range_m = roomy_m;
  }

  setRange(range_m) {
    const steps_m = rangeSteps_m(this.settings);
    this.view.range_m = Math.min(Math.max(range_m, steps_m[0]), steps_m.at(-1));
    this.settings.range_m = this.view.range_m;
    this.settings.set("autoRange", false);
    this.settings.save();
    this.redraw();
  }

  /** Changes the range by one step: nearer (+1) or farther (-1). */
  zoom(by) {
    const steps_m = rangeSteps_m(this.settings);
    const range_m = this.view.range_m;
    const nearer_m = steps_m.findLast((step_m) => step_m < range_m * 0.99);
    const farther_m = steps_m.find((step_m) => step_m > range_m * 1.01);
    const next_m = by > 0 ? nearer_m : farther_m;
    if (next_m !== undefined) this.setRange(next_m);
  }

  listen() {
    const { canvas } = this;
    canvas.addEventListener("wheel", (event) => this.onWheel(event), { passive: false });
    canvas.addEventListener("pointerdown", (event) => this.onDown(event));
    canvas.addEventListener("pointermove", (event) => this.onMove(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, (event) => this.onUp(event));
  }

  onWheel(event) {
    event.preventDefault();
    this.wheel += event.deltaMode === 1 ? event.deltaY * 30 : event.deltaY;
    if (Math.abs(this.wheel) < WHEEL_STEP) return;
    this.zoom(this.wheel < 0 ? 1 : -1);
    this.wheel = 0;
  }

  onDown(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (this.fingers.size === 2) this.pinch = { spread_px: this.spread_px(), range_m: this.view.range_m };
  }

  onMove(event) {
    if (!this.fingers.has(event.pointerId)) return;
    this.fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (this.fingers.size !== 2 || this.pinch === undefined) return;
    this.setRange((this.pinch.range_m * this.pinch.spread_px) / Math.max(this.spread_px(), 10));
  }

  onUp(event) {
    const alone = this.fingers.size === 1 && this.pinch === undefined;
    this.fingers.delete(event.pointerId);
    if (this.fingers.size === 0) this.pinch = undefined;
    if (event.type !== "pointerup" || !alone) return;
    const key = pick(this.places, this.ownPlace, [event.offsetX, event.offsetY], TOUCH_PX);
    if (key !== null) this.onSelect(key);
  }

  spread_px() {
    const [[fromX, fromY], [toX, toY]] = [...this.fingers.values()];
    return Math.hypot(fromX - toX, fromY - toY);
  }
}
