// The members of a formation that share this page: their states, and links to each one's picture.

import { find, make, setAttribute, setData, setText, show } from "../core/dom.js";
import { getJson, member } from "../core/server.js";

const EVERY_MS = 1000;
const LEVELS = { clear: "clear", outer: "caution", inner: "warning" };

export class MembersPanel {
  constructor() {
    this.rows = new Map();
    this.asking = null;
  }

  /** Shows the members by these names; none: one aircraft, without a selector. */
  offer(names) {
    const known = Array.isArray(names) ? names : [];
    show(find("members"), known.length > 0);
    for (const name of known) if (!this.rows.has(name)) this.add(name, member === null ? known[0] : member);
    if (known.length > 0 && this.asking === null) {
      this.asking = setInterval(() => this.ask(), EVERY_MS);
      this.ask();
    }
  }

  add(name, shown) {
    const row = { mark: make("span", "mark"), state: make("span", "member-state") };
    const link = make("a", "", row.mark, make("strong", "", name), row.state);
    link.href = `?member=${encodeURIComponent(name)}`;
    if (name === shown) setAttribute(link, "aria-current", "page");
    row.link = link;
    setData(row.mark, "level", "none");
    setAttribute(row.mark, "aria-hidden", "true");
    find("members").append(link);
    this.rows.set(name, row);
  }

  async ask() {
    const answer = await getJson("api/members");
    for (const one of Array.isArray(answer) ? answer : []) this.update(one);
  }

  update({ name, fresh, layer, state, mode }) {
    const row = this.rows.get(name);
    if (row === undefined) return;
    setData(row.link, "layer", fresh ? (layer ?? "none") : "none");
    setData(row.mark, "level", fresh ? (LEVELS[layer] ?? "none") : "none");
    setText(row.state, fresh ? `${mode ?? "–"} · ${state ?? "–"}` : "no data");
  }
}
