// Draws a frame with what is known of it. Places are px of the film, the middle of the first pixel at (0, 0).

export const MISSING = 0, AMBIGUOUS = 3, MANUAL = 5;
export const STATES = ["missing", "seen", "reacquired", "ambiguous", "undecoded", "manual"];
export const COLOURS = ["#56b4e9", "#e69f00", "#2fbf93", "#f0e442", "#d98fb8", "#ff7f50", "#a0e060", "#c0a0ff"];

// Marks grow with the page's letters, so that they are as easy to see on a large screen.
export const unit = () => parseFloat(getComputedStyle(document.documentElement).fontSize) / 16;

export const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class View {
  constructor(canvas) {
    this.canvas = canvas;
    this.scale = 1; this.x = 0; this.y = 0; this.fitted = true;
  }

  // Makes the canvas as sharp as the screen.
  measure() {
    const ratio = devicePixelRatio || 1, box = this.canvas.getBoundingClientRect();
    this.width = box.width; this.height = box.height;
    const [w, h] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) Object.assign(this.canvas, { width: w, height: h });
    return ratio;
  }

  fit(width, height) {
    this.measure();
    this.scale = Math.min(this.width / width, this.height / height);
    this.x = (this.width - width * this.scale) / 2;
    this.y = (this.height - height * this.scale) / 2;
    this.fitted = true;
  }

  zoom(factor, at) {
    const scale = Math.min(64, Math.max(0.05, this.scale * factor));
    this.x = at[0] - (at[0] - this.x) * scale / this.scale;
    this.y = at[1] - (at[1] - this.y) * scale / this.scale;
    this.scale = scale; this.fitted = false;
  }

  toScreen([x, y]) { return [this.x + (x + 0.5) * this.scale, this.y + (y + 0.5) * this.scale]; }
  toFilm([x, y]) { return [(x - this.x) / this.scale - 0.5, (y - this.y) / this.scale - 0.5]; }

  draw(picture, film, paint) {
    const ratio = this.measure(), context = this.canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = "#000";
    context.fillRect(0, 0, this.width, this.height);
    if (picture) {
      context.imageSmoothingEnabled = this.scale < 1;
      context.drawImage(picture, this.x, this.y, film.width * this.scale, film.height * this.scale);
    }
    paint(context);
  }
}

function halo(context, path, colour, width) {
  const by = unit();
  context.beginPath();
  path();
  context.strokeStyle = "rgba(0,0,0,0.75)"; context.lineWidth = (width + 2) * by; context.stroke();
  context.strokeStyle = colour; context.lineWidth = width * by; context.stroke();
}

export function label(context, text, x, y, colour, size = 13) {
  context.font = `${size * unit()}px system-ui, sans-serif`;
  context.textBaseline = "middle";
  context.strokeStyle = "rgba(0,0,0,0.85)"; context.lineWidth = 4; context.lineJoin = "round";
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}

export function ring(context, [x, y], radius, colour, width = 2) {
  halo(context, () => context.arc(x, y, radius, 0, 2 * Math.PI), colour, width);
}

export function cross(context, [x, y], size, colour, width = 2) {
  size *= unit();
  halo(context, () => {
    context.moveTo(x - size, y); context.lineTo(x + size, y);
    context.moveTo(x, y - size); context.lineTo(x, y + size);
  }, colour, width);
}

export function box(context, a, b, colour) {
  halo(context, () => context.rect(Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.abs(b[0] - a[0]), Math.abs(b[1] - a[1])), colour, 2);
}

export function nodes(context, view, row, names, bodies, chosen) {
  if (!row) return;
  row.forEach(([x, y, sigma, status], k) => {
    if (x === null) return;
    const at = view.toScreen([x, y]), colour = COLOURS[bodies[k] % COLOURS.length];
    const radius = (names[k] === chosen ? 11 : 7) * unit();
    ring(context, at, radius, colour, names[k] === chosen ? 3 : 1.5);
    if (status === MANUAL) ring(context, at, radius + 4, "#ffffff", 1);
    if (sigma * view.scale > radius + 6) ring(context, at, sigma * view.scale, colour, 1);
    label(context, names[k], at[0] + radius + 4, at[1], colour);
  });
}
