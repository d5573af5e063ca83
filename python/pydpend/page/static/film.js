// The frames of the film and the rows of the table, kept for a while once they came.
import { ask, picture } from "./api.js";

const MOST_PICTURES = 160;
const BLOCK = 100;

export class Film {
  constructor() {
    this.pictures = new Map();
    this.blocks = new Map();
    this.version = -1;
    this.levels = { low: null, high: null };
  }

  setLevels(low, high) {
    this.levels = { low, high };
    this.pictures.clear();
  }

  setVersion(version) {
    if (version !== this.version) this.blocks.clear();
    this.version = version;
  }

  picture(index, width = null) {
    const key = `${index}/${width}`;
    let found = this.pictures.get(key);
    if (!found) {
      found = picture(index, { ...this.levels, width });
      found.catch(() => this.pictures.delete(key));
      this.pictures.set(key, found);
      while (this.pictures.size > MOST_PICTURES) this.pictures.delete(this.pictures.keys().next().value);
    }
    return found;
  }

  // The row of a frame: for each node [x, y, sigma, status], or null where the table has none.
  async row(index) {
    const block = Math.floor(index / BLOCK);
    let found = this.blocks.get(block);
    if (!found) {
      found = ask("rows", { first: block * BLOCK, last: (block + 1) * BLOCK });
      found.catch(() => this.blocks.delete(block));
      this.blocks.set(block, found);
    }
    const { frame, rows } = await found;
    const at = frame.indexOf(index);
    return at < 0 ? null : rows[at];
  }
}
