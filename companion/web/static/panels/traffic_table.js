// The table of traffic, the most urgent first. Each row belongs to one track, so that it keeps the focus when it moves.

import { find, make, setAttribute, setData, setText } from "../core/dom.js";
import { evidenceText, stateOf } from "../core/evidence.js";
import { climbDirection, nameOf } from "../core/tracks.js";
import { countdownText, courseText, distanceText, relativeHeightText } from "../core/units.js";

const ALARMING = ["caution", "warning"];
const CLIMB_ARROWS = { 1: "↑", [-1]: "↓" };

export class TrafficTable {
  constructor(settings, onSelect) {
    Object.assign(this, { settings, onSelect });
    this.body = find("traffic");
    this.rows = new Map();
    this.spare = [];
    this.pointed = false; // the mouse is over the table
    this.alarms = "";
    const frame = find("traffic-frame");
    frame.addEventListener("pointerenter", (event) => (this.pointed = event.pointerType === "mouse"));
    frame.addEventListener("pointerleave", () => (this.pointed = false));
    this.body.addEventListener("click", (event) => this.choose(event.target));
    this.body.addEventListener("keydown", (event) => this.move(event));
  }

  /** `ordered` is {track, threat} by urgency; `bearing(track)` returns its bearing [deg]. */
  update(ordered, selected, bearing) {
    setText(find("traffic-count"), ordered.length === 0 ? "none" : String(ordered.length));
    setText(find("relative-column"), `Height ${this.settings.height}`);
    const present = new Set(ordered.map(({ track }) => track.track));
    for (const key of this.rows.keys()) if (!present.has(key)) this.remove(key);
    for (const entry of ordered) this.fill(entry, selected, bearing);
    // The order waits while the mouse is over the table, unless the alarms change: rows must not move away from it.
    const alarms = ordered.filter(({ track }) => ALARMING.includes(track.level)).map(({ track }) => track.track).join();
    if (!this.pointed || alarms !== this.alarms) this.arrange(ordered);
    this.alarms = alarms;
  }

  fill({ track, threat }, selected, bearing) {
    const row = this.rows.get(track.track) ?? this.add(track.track);
    setData(row.element, "level", track.level);
    setData(row.element, "selected", track.track === selected);
    setData(row.element, "state", stateOf(track));
    setData(row.symbol, "level", track.level);
    setData(row.symbol, "state", stateOf(track));
    setAttribute(row.button, "aria-pressed", track.track === selected);
    setAttribute(row.button, "aria-label", `${nameOf(track)}, ${track.level}, ${stateOf(track)}`);
    setText(row.name, nameOf(track));
    setText(row.evidence, evidenceText(track, this.settings));
    setText(row.distance, distanceText(track.distance_m, this.settings));
    setText(row.bearing, courseText(bearing(track)));
    setText(row.height, relativeHeightText(track.relative_altitude_m, this.settings));
    setText(row.climb, CLIMB_ARROWS[climbDirection(track)] ?? "");
    setText(row.closest, (threat?.time_to_closest_s ?? null) === null ? "" : countdownText(threat.time_to_closest_s));
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

  /** Moves only the rows that are out of order, and restores the focus if a move takes it away. */
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
  const evidence = make("td", "evidence");
  const [height, climb] = [make("span"), make("span", "climb")];
  const heights = make("td", "", height, climb);
  const element = make("tr", "", make("td", "", button), evidence, distance, bearing, heights, closest);
  return { element, button, symbol, name, evidence, distance, bearing, height, climb, closest };
}
