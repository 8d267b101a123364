// The controls: buttons on the map, the settings dialog, and the keyboard.

import { find, make, setAttribute, setText } from "../core/dom.js";
import { rangeText } from "../core/units.js";

const NOT_TEXT = ["trend_s", "autoRange"]; // settings whose values are parsed from the text of a select
const BUTTON_KEYS = [" ", "Enter"];

export class Controls {
  constructor(settings, scope) {
    Object.assign(this, { settings, scope });
    this.selects = [...document.querySelectorAll("[data-setting]")];
    const press = (id, act) => find(id).addEventListener("click", act);
    press("orientation", () => settings.next("orientation"));
    press("height-unit", () => settings.next("height"));
    press("trend", () => settings.next("trend_s"));
    press("auto-range", () => settings.next("autoRange"));
    press("zoom-in", () => scope.zoom(1));
    press("zoom-out", () => scope.zoom(-1));
    for (const kind of ["display", "help"]) press(`${kind}-button`, () => find(`${kind}-dialog`).showModal());
    for (const select of this.selects) select.addEventListener("change", () => this.read(select));
    this.update();
  }

  read(select) {
    const name = select.dataset.setting;
    this.settings.set(name, NOT_TEXT.includes(name) ? JSON.parse(select.value) : select.value);
  }

  update() {
    const { settings } = this;
    setText(find("orientation"), settings.orientation === "north" ? "N UP" : "TRK UP");
    setText(find("height-unit"), settings.height === "ft" ? "ALT FT" : "ALT M");
    setText(find("trend"), `VEC ${settings.trend_s}`);
    setAttribute(find("auto-range"), "aria-pressed", settings.autoRange);
    for (const select of this.selects) select.value = String(settings[select.dataset.setting]);
    this.updateRange();
  }

  updateRange() {
    setText(find("range"), rangeText(this.scope.view.range_m, this.settings));
  }
}

const stepOf_s = (event) => (event.shiftKey ? 10 : 1);

/** [keys as written in the help, meaning, values of `event.key`, action on the display] */
const KEYS = [
  ["+  -", "Zoom in, out", ["+", "="], (display) => display.scope.zoom(1)],
  [null, null, ["-", "_"], (display) => display.scope.zoom(-1)],
  ["A", "Automatic range", ["a"], (display) => display.settings.next("autoRange")],
  ["T", "North up, track up", ["t"], (display) => display.settings.next("orientation")],
  ["U", "Heights in metres, feet", ["u"], (display) => display.settings.next("height")],
  ["V", "Trend vectors 60 s, 30 s", ["v"], (display) => display.settings.next("trend_s")],
  ["J  K", "Next, previous aircraft", ["j"], (display) => display.selectNext(1)],
  [null, null, ["k"], (display) => display.selectNext(-1)],
  ["F", "Centre on the selected aircraft", ["f"], (display) => display.toggleFollow()],
  ["O  Esc", "Own aircraft", ["o", "Escape"], (display) => display.select("own")],
  ["← →", "1 s back, forward; with Shift 10 s", ["ArrowLeft"], (display, event) => display.step(-stepOf_s(event))],
  [null, null, ["ArrowRight"], (display, event) => display.step(stepOf_s(event))],
  ["Home  End", "Oldest moment, newest moment", ["Home"], (display) => display.moments.first()],
  [null, null, ["End"], (display) => display.moments.last()],
  ["L", "Back to live", ["l"], (display) => display.moments.live?.()],
  ["Space", "Play, pause a replay", [" "], (display) => display.moments.togglePlay?.()],
  [",  .", "Slower, faster replay", [","], (display) => display.moments.shiftSpeed?.(-1)],
  [null, null, ["."], (display) => display.moments.shiftSpeed?.(1)],
  ["N", "Theme: automatic, day, night", ["n"], (display) => display.settings.next("theme")],
  ["D", "Display settings", ["d"], () => find("display-dialog").showModal()],
  ["?", "This help", ["?"], () => find("help-dialog").showModal()],
];

/** True when an open dialog or the focused element needs the key. */
function isTaken(event) {
  const { target, key } = event;
  if (!(target instanceof Element)) return false;
  if (document.querySelector("dialog[open]") !== null) return true;
  if (target.closest("input, select, textarea") !== null) return true;
  return target.closest("button") !== null && BUTTON_KEYS.includes(key);
}

/** Binds the keys, and lists them in the help. */
export function listenToKeys(display) {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented || isTaken(event)) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    const entry = KEYS.find(([, , keys]) => keys.includes(key));
    if (entry === undefined) return;
    event.preventDefault();
    entry[3](display, event);
  });
  for (const [written, meaning] of KEYS) {
    if (written !== null) find("keys").append(make("div", "", make("dt", "", written), make("dd", "", meaning)));
  }
}
