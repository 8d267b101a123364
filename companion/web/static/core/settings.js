// The user's choices, kept in the browser where that is allowed, and the theme that follows from them.

const KEY = "companion.display";

const CHOICES = {
  theme: ["auto", "day", "night"],
  orientation: ["north", "track"],
  height: ["m", "ft"],
  distance: ["km", "nm"],
  trend_s: [60, 30],
  autoRange: [true, false],
};

function stored() {
  try {
    return JSON.parse(localStorage.getItem(KEY)) ?? {};
  } catch {
    return {}; // no storage allowed, or not our format: use the defaults
  }
}

export class Settings {
  constructor(changed) {
    this.changed = changed;
    const before = stored();
    this.chosen = Object.keys(before).filter((name) => CHOICES[name]?.includes(before[name]));
    for (const [name, allowed] of Object.entries(CHOICES)) {
      this[name] = this.chosen.includes(name) ? before[name] : allowed[0];
    }
    this.range_m = Number.isFinite(before.range_m) ? before.range_m : 6000;
    this.dark = matchMedia("(prefers-color-scheme: dark)");
    this.dark.addEventListener("change", () => this.applyTheme());
    this.applyTheme();
  }

  /** Sets a value unless the user has chosen one. */
  suggest(name, value) {
    if (this.chosen.includes(name) || !CHOICES[name].includes(value) || this[name] === value) return;
    this[name] = value;
    this.changed(name);
  }

  set(name, value) {
    if (this[name] === value) return;
    this[name] = value;
    if (!this.chosen.includes(name)) this.chosen.push(name);
    this.save();
    if (name === "theme") this.applyTheme();
    else this.changed(name);
  }

  /** Sets the next of the allowed values; the first follows the last. */
  next(name) {
    const allowed = CHOICES[name];
    this.set(name, allowed[(allowed.indexOf(this[name]) + 1) % allowed.length]);
  }

  save() {
    const values = { ...Object.fromEntries(this.chosen.map((name) => [name, this[name]])), range_m: this.range_m };
    try {
      localStorage.setItem(KEY, JSON.stringify(values));
    } catch {
      return; // then the choice lasts as long as the page
    }
  }

  applyTheme() {
    const theme = this.theme === "auto" ? (this.dark.matches ? "night" : "day") : this.theme;
    document.documentElement.dataset.theme = theme;
    this.changed("theme");
  }
}
