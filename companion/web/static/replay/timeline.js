// The strip below the map: layers over time with the moment shown, and the controls of a replay.

import { find, fitCanvas, setAttribute, setData, setText, show } from "../core/dom.js";
import { lastBefore } from "../core/history.js";
import { FONT, layerColour } from "../core/palette.js";
import { SPEEDS } from "./moments.js";

const EDGE_PX = 8;
const HEIGHT_SHARE = { clear: 0.16, outer: 0.58, inner: 1 }; // layers differ in height, not in colour alone
const MARKS_PX = 15;

export class Timeline {
  constructor(redraw) {
    this.redraw = redraw;
    this.canvas = find("timeline");
    this.pen = this.canvas.getContext("2d");
    this.source = null; // LiveMoments or ReplayMoments
    this.stale = false; // no data arrives
    new ResizeObserver(() => this.resize()).observe(this.canvas);
    this.listen();
  }

  resize() {
    const { box, ratio } = fitCanvas(this.canvas);
    Object.assign(this, { ratio, width_px: box.width, height_px: box.height });
    this.redraw();
  }

  listen() {
    const { canvas } = this;
    const seek = (event) => this.source?.show(this.timeAt_s(event.offsetX));
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      seek(event);
    });
    canvas.addEventListener("pointermove", (event) => canvas.hasPointerCapture(event.pointerId) && seek(event));
  }

  x_px(at_s) {
    const { from_s, to_s } = this.source;
    return EDGE_PX + ((at_s - from_s) / (to_s - from_s || 1)) * (this.width_px - 2 * EDGE_PX);
  }

  timeAt_s(x_px) {
    const { from_s, to_s } = this.source;
    const share = (x_px - EDGE_PX) / Math.max(1, this.width_px - 2 * EDGE_PX);
    return from_s + Math.min(Math.max(share, 0), 1) * (to_s - from_s);
  }

  draw(palette) {
    if (this.source === null || this.width_px === undefined) return;
    const { pen } = this;
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.clearRect(0, 0, this.width_px, this.height_px);
    this.drawLayers(palette);
    this.drawMarks(palette);
    this.drawMoment(palette);
    this.updateText();
  }

  drawLayers(palette) {
    const { pen, source } = this;
    const { changes, from_s, to_s } = source;
    const bottom_px = this.height_px - MARKS_PX;
    pen.fillStyle = palette.faint;
    pen.fillRect(EDGE_PX, 0, this.width_px - 2 * EDGE_PX, bottom_px);
    for (let index = Math.max(0, lastBefore(changes, from_s)); index < changes.length; index++) {
      const { at_s, layer } = changes[index];
      if (!(layer in HEIGHT_SHARE)) continue;
      const left_px = this.x_px(Math.max(at_s, from_s));
      const right_px = this.x_px(Math.min(changes[index + 1]?.at_s ?? to_s, to_s));
      const height_px = bottom_px * HEIGHT_SHARE[layer];
      pen.fillStyle = layer === "outer" ? palette.amber : layerColour(palette, layer, palette.clear);
      pen.fillRect(left_px, bottom_px - height_px, Math.max(right_px - left_px, 1.5), height_px);
      if (layer !== changes[index - 1]?.layer || at_s <= from_s) continue;
      pen.fillStyle = palette.ink; // another manoeuvre in the same layer
      pen.fillRect(left_px - 0.5, bottom_px - height_px, 1, height_px);
    }
  }

  drawMarks(palette) {
    const { pen } = this;
    pen.font = `500 11px ${FONT}`;
    pen.textAlign = "center";
    pen.textBaseline = "bottom";
    pen.fillStyle = palette.quiet;
    let free_px = 0;
    for (const [at_s, words] of this.source.marks().sort((a, b) => a[0] - b[0])) {
      const x_px = this.x_px(at_s);
      const half_px = pen.measureText(words).width / 2;
      pen.fillRect(x_px - 0.5, this.height_px - MARKS_PX, 1, 4);
      if (x_px - half_px < free_px || x_px + half_px > this.width_px) continue;
      pen.fillText(words, x_px, this.height_px + 1);
      free_px = x_px + half_px + 10;
    }
  }

  drawMoment(palette) {
    const { pen, source } = this;
    const x_px = this.x_px(Math.max(source.at_s, source.from_s));
    const bottom_px = this.height_px - MARKS_PX;
    pen.fillStyle = source.isPast ? palette.past : palette.ink;
    pen.fillRect(x_px - 1.25, 0, 2.5, bottom_px);
    pen.beginPath();
    pen.moveTo(x_px - 7, 0);
    pen.lineTo(x_px + 7, 0);
    pen.lineTo(x_px, 10);
    pen.closePath();
    pen.fill();
  }

  updateText() {
    const { source, canvas } = this;
    setText(find("moment"), this.stale ? "NO DATA" : source.label);
    setAttribute(canvas, "aria-valuemin", Math.round(source.from_s));
    setAttribute(canvas, "aria-valuemax", Math.round(source.to_s));
    setAttribute(canvas, "aria-valuenow", Math.round(source.at_s));
    setAttribute(canvas, "aria-valuetext", source.label);
  }
}

/** The play button and the speed of a replay. */
export class ReplayControls {
  constructor(replay) {
    this.replay = replay;
    this.speed = find("speed");
    show(find("replay-controls"), true);
    find("play").addEventListener("click", () => this.replay.togglePlay());
    this.speed.addEventListener("change", () => this.replay.setSpeed(Number(this.speed.value)));
  }

  update() {
    const { playing, speed } = this.replay;
    setData(document.documentElement, "playing", playing);
    setAttribute(find("play"), "aria-label", playing ? "Pause" : "Play");
    const offered = [...new Set([...SPEEDS, speed])].sort((a, b) => a - b);
    if (this.speed.options.length !== offered.length) {
      this.speed.replaceChildren(...offered.map((each) => new Option(`${each} x`, String(each))));
    }
    if (this.speed.value !== String(speed)) this.speed.value = String(speed);
  }
}
