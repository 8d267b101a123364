// Text on the canvas without overlaps: the first label keeps its place, later ones move around it.

import { FONT } from "../core/palette.js";

const HALO_PX = 3;
const MOST_WIDTHS = 2000;

export class Labels {
  constructor() {
    this.taken = [];
    this.widths = new Map();
    this.sides = new Map(); // the last side of each symbol's label: labels that jump cannot be read
  }

  /** Starts a new drawing. */
  clear(pen, ground, { width_px, height_px }) {
    Object.assign(this, { pen, ground, width_px, height_px });
    this.taken.length = 0;
  }

  measure(text, font) {
    const key = font + text;
    let width_px = this.widths.get(key);
    if (width_px === undefined) {
      if (this.widths.size > MOST_WIDTHS) this.widths.clear();
      this.pen.font = font;
      width_px = this.pen.measureText(text).width;
      this.widths.set(key, width_px);
    }
    return width_px;
  }

  take(x, y, width, height) {
    this.taken.push([x, y, x + width, y + height]);
  }

  /** True when a box is on the canvas and free. Boxes taken before number `from` do not count. */
  free(x, y, width, height, from = 0) {
    if (x < 0 || y < 0 || x + width > this.width_px || y + height > this.height_px) return false;
    for (let index = from; index < this.taken.length; index++) {
      const [left, top, right, bottom] = this.taken[index];
      if (x < right && x + width > left && y < bottom && y + height > top) return false;
    }
    return true;
  }

  /** Writes text at a place, even over other text; `y` is its middle. Returns its width. */
  write(text, x, y, { colour, size_px = 12, weight = 500, align = "center", keep = true }) {
    const font = `${weight} ${size_px}px ${FONT}`;
    const width = this.measure(text, font);
    const left = align === "center" ? x - width / 2 : align === "right" ? x - width : x;
    if (keep) this.take(left - 1, y - size_px / 2, width + 2, size_px);
    const { pen } = this;
    pen.font = font;
    pen.textAlign = "left";
    pen.textBaseline = "middle";
    pen.lineJoin = "round";
    pen.lineWidth = HALO_PX;
    pen.strokeStyle = this.ground;
    pen.strokeText(text, left, y);
    pen.fillStyle = colour;
    pen.fillText(text, left, y);
    return width;
  }

  /** Writes text beside a symbol: right, left, or at a corner. Without room it is left out, unless `must` is set.
   * Returns whether it was written. */
  beside(key, text, [x, y], clear_px, style) {
    const font = `${style.weight ?? 500} ${style.size_px ?? 12}px ${FONT}`;
    const width = this.measure(text, font);
    const height = style.size_px ?? 12;
    const corner = clear_px * 0.6;
    const places = [
      [x + clear_px, y], [x - clear_px - width, y],
      [x + corner, y - corner - height * 0.7], [x + corner, y + corner + height * 0.7],
      [x - corner - width, y - corner - height * 0.7], [x - corner - width, y + corner + height * 0.7],
    ];
    const former = this.sides.get(key);
    const order = former === undefined ? [0, 1, 2, 3, 4, 5] : [former, 0, 1, 2, 3, 4, 5];
    const fits = (side) => this.free(places[side][0] - 1, places[side][1] - height / 2, width + 2, height);
    const side = order.find(fits) ?? (style.must ? 0 : null);
    if (side === null) return false;
    if (this.sides.size > MOST_WIDTHS) this.sides.clear();
    this.sides.set(key, side);
    this.write(text, ...places[side], { ...style, align: "left" });
    return true;
  }
}
