// The table of traffic, the most urgent first. A row stays with its aircraft, so that focus and finger stay too.

import { climbArrow } from "./details.js";
import { find, make, mark, put } from "./dom.js";
import { nameOf } from "./state.js";
import { isOld } from "./traffic.js";
import { courseText, distanceText, durationText, relativeHeightText } from "./units.js";

const ALARMING = ["caution", "warning"];

export class TrafficTable {
  constructor(settings, onSelect) {
    Object.assign(this, { settings, onSelect });
    this.body = find("traffic");
    this.rows = new Map();
    this.spare = [];
    this.pointed = false; // by a mouse
    this.alarms = "";
    const frame = find("traffic-frame");
    frame.addEventListener("pointerenter", (event) => (this.pointed = event.pointerType === "mouse"));
    frame.addEventListener("pointerleave", () => (this.pointed = false));
    this.body.addEventListener("click", (event) => this.choose(event.target));
    this.body.addEventListener("keydown", (event) => this.move(event));
  }

  /** `ordered` is {track, threat} by urgency; `bearing(track)` gives its bearing [deg]. */
  update(ordered, selected, bearing) {
    put(find("traffic-count"), ordered.length === 0 ? "none" : String(ordered.length));
    put(find("relative-column"), `Height ${this.settings.height}`);
    const present = new Set(ordered.map(({ track }) => track.track));
    for (const key of this.rows.keys()) if (!present.has(key)) this.remove(key);
    for (const entry of ordered) this.fill(entry, selected, bearing);
    // Rows do not run away from under a mouse: the order waits until it has gone, or until somebody else alarms.
    const alarms = ordered.filter(({ track }) => ALARMING.includes(track.level)).map(({ track }) => track.track).join();
    if (!this.pointed || alarms !== this.alarms) this.arrange(ordered);
    this.alarms = alarms;
  }

  fill({ track, threat }, selected, bearing) {
    const row = this.rows.get(track.track) ?? this.add(track.track);
    mark(row.element, "level", track.level);
    mark(row.element, "selected", track.track === selected);
    mark(row.element, "old", isOld(track));
    mark(row.symbol, "level", track.level);
    mark(row.symbol, "old", isOld(track));
    row.button.setAttribute("aria-pressed", String(track.track === selected));
    row.button.setAttribute("aria-label", `${nameOf(track)}, ${track.level}`);
    put(row.name, nameOf(track));
    put(row.distance, distanceText(track.distance_m, this.settings));
    put(row.bearing, courseText(bearing(track)));
    put(row.height, relativeHeightText(track.relative_altitude_m, this.settings));
    put(row.climb, climbArrow(track));
    put(row.closest, (threat?.time_to_closest_s ?? null) === null ? "" : durationText(threat.time_to_closest_s));
  }

  add(key) {
    const row = this.spare.pop() ?? makeRow();
    row.element.dataset.track = key;
    this.rows.set(key, row);
    this.body.append(row.element);
    return row;
  }

  remove(key) {
    const row = this.rows.get(key);
    row.element.remove();
    this.rows.delete(key);
    this.spare.push(row);
  }

  /** Moves only the rows that are out of order, and gives the focus back to one that loses it by that. */
  arrange(ordered) {
    const focused = this.body.contains(document.activeElement) ? document.activeElement : null;
    let next = this.body.firstElementChild;
    for (const { track } of ordered) {
      const { element } = this.rows.get(track.track);
      if (element === next) next = next.nextElementSibling;
      else this.body.insertBefore(element, next);
    }
    if (focused !== null && document.activeElement !== focused) focused.focus({ preventScroll: true });
  }

  choose(target) {
    const key = target.closest("tr")?.dataset.track;
    if (key !== undefined) this.onSelect(key);
  }

  move(event) {
    const step = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
    if (step === undefined) return;
    event.preventDefault();
    event.target.closest("tr")?.[step]?.querySelector("button").focus();
  }
}

function makeRow() {
  const symbol = make("span", "mark");
  const name = make("span", "name");
  const button = make("button", "", symbol, name);
  button.type = "button";
  const [distance, bearing, closest] = Array.from({ length: 3 }, () => make("td"));
  const [height, climb] = [make("span"), make("span", "climb")];
  const element = make("tr", "", make("td", "", button), distance, bearing, make("td", "", height, climb), closest);
  return { element, button, symbol, name, distance, bearing, height, climb, closest };
}
