// The colours of the canvas. They are read from themes.css, so that a theme is written in one place.

const NAMES = [
  "ground", "ink", "quiet", "faint", "grid", "own", "traffic", "caution", "amber", "warning", "clear", "edge",
  "commanded", "mission", "fence", "path", "past",
];

export const FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';

export function readPalette() {
  const style = getComputedStyle(document.documentElement);
  return Object.fromEntries(NAMES.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** The colour of an alarming layer; `calm` for any other. */
export function layerColour(palette, layer, calm = palette.quiet) {
  return { inner: palette.warning, outer: palette.caution }[layer] ?? calm;
}

/** The fill of a symbol. By day its amber is brighter than the amber of text, which has to stay readable. */
export function levelFill(palette, level) {
  return level === "caution" ? palette.amber : levelColour(palette, level);
}

export function levelColour(palette, level) {
  return { warning: palette.warning, caution: palette.caution }[level] ?? palette.traffic;
}
