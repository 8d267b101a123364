// What is not avoided, and why; and traffic about which something is odd.

import { find, make, setData, setText, show } from "../core/dom.js";
import { concernName, whereText, whyText } from "../core/evidence.js";

export class ConcernsPanel {
  constructor(settings) {
    this.settings = settings;
    this.rows = [];
    this.panel = find("concerns-panel");
    this.list = find("concerns");
  }

  update({ concerns, own }) {
    show(this.panel, concerns.length > 0);
    while (this.rows.length < concerns.length) this.addRow();
    this.rows.forEach((row, index) => {
      show(row.element, index < concerns.length);
      if (index < concerns.length) this.fill(row, concerns[index], own);
    });
  }

  addRow() {
    const [name, where, why] = ["name", "where", "why"].map((kind) => make("span", kind));
    const element = make("li", "", name, where, why);
    this.list.append(element);
    this.rows.push({ element, name, where, why });
  }

  fill(row, concern, own) {
    setData(row.element, "avoided", concern.avoided);
    setText(row.name, concernName(concern));
    setText(row.where, whereText(concern, own, this.settings));
    setText(row.why, `${concern.avoided ? "Avoided" : "Not avoided"}: ${whyText(concern)}`);
  }
}
