// The keyboard: which key does what, and the list of it in the help.

import { find, make } from "./dom.js";

const stepOf_s = (event) => (event.shiftKey ? 10 : 1);

/** [what is written in the help, its meaning, the keys, what is done with `display` and the event] */
const KEYS = [
  ["+  -", "Nearer, farther", ["+", "="], (display) => display.scope.zoom(1)],
  [null, null, ["-", "_"], (display) => display.scope.zoom(-1)],
  ["A", "Automatic range", ["a"], (display) => display.settings.next("autoRange")],
  ["T", "North up, track up", ["t"], (display) => display.settings.next("orientation")],
  ["U", "Heights in metres, feet", ["u"], (display) => display.settings.next("height")],
  ["V", "Trend vectors 60 s, 30 s", ["v"], (display) => display.settings.next("trend_s")],
  ["J  K", "Next, previous aircraft", ["j"], (display) => display.selectNext(1)],
  [null, null, ["k"], (display) => display.selectNext(-1)],
  ["F", "Centre on the selected one", ["f"], (display) => display.toggleFollow()],
  ["O  Esc", "Own aircraft", ["o", "Escape"], (display) => display.select("own")],
  ["← →", "Back, forth by 1 s; with Shift 10 s", ["ArrowLeft"], (display, event) => display.step(-stepOf_s(event))],
  [null, null, ["ArrowRight"], (display, event) => display.step(stepOf_s(event))],
  ["Home  End", "The oldest moment, the newest", ["Home"], (display) => display.moments.first()],
  [null, null, ["End"], (display) => display.moments.last()],
  ["L", "Back to live", ["l"], (display) => display.moments.live?.()],
  ["Space", "Play, pause a replay", [" "], (display) => display.moments.togglePlay?.()],
  [",  .", "Slower, faster replay", [","], (display) => display.moments.shiftSpeed?.(-1)],
  [null, null, ["."], (display) => display.moments.shiftSpeed?.(1)],
  ["N", "Theme: automatic, day, night", ["n"], (display) => display.settings.next("theme")],
  ["D", "Display settings", ["d"], () => find("display-dialog").showModal()],
  ["?", "This help", ["?"], () => find("help-dialog").showModal()],
];

const BUTTON_KEYS = [" ", "Enter"];

/** Does what has the focus need the key for itself? */
function isTaken(event) {
  const { target, key } = event;
  if (!(target instanceof Element)) return false;
  if (document.querySelector("dialog[open]") !== null) return true;
  if (target.closest("input, select, textarea") !== null) return true;
  return target.closest("button") !== null && BUTTON_KEYS.includes(key);
}

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
