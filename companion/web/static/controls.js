// The buttons on the scope and the dialog of settings: both show and change the same settings.

import { find, put } from "./dom.js";
import { rangeText } from "./units.js";

const NUMERIC = ["trend_s", "autoRange"]; // not words: what a select holds has to be read

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
    this.settings.set(name, NUMERIC.includes(name) ? JSON.parse(select.value) : select.value);
  }

  update() {
    const { settings } = this;
    put(find("orientation"), settings.orientation === "north" ? "N UP" : "TRK UP");
    put(find("height-unit"), settings.height === "ft" ? "ALT FT" : "ALT M");
    put(find("trend"), `VEC ${settings.trend_s}`);
    find("auto-range").setAttribute("aria-pressed", String(settings.autoRange));
    for (const select of this.selects) select.value = String(settings[select.dataset.setting]);
    this.updateRange();
  }

  updateRange() {
    put(find("range"), rangeText(this.scope.view.range_m, this.settings));
  }
}
