// Everything by keys.
import { assign, nextDoubt, nothing } from "./check.js";
import { steps } from "./steps.js";

const MOVES = { i: [0, -1], k: [0, 1], j: [-1, 0], l: [1, 0] };

export function listen(app, play) {
  addEventListener("keydown", (e) => {
    if (e.altKey && /^Digit[1-9]$/.test(e.code)) {
      const step = steps.ids[Number(e.code.slice(5)) - 1];
      if (step) { e.preventDefault(); app.enter(step); document.getElementById(`step-${step}`).focus(); }
      return;
    }
    if (e.ctrlKey || e.metaKey || e.altKey || e.target.matches("input, select, textarea")) return;
    const key = e.key.length === 1 ? e.key.toLowerCase() : e.key;
    // Buttons keep Enter and space.
    const pressed = e.target.matches("button, summary");
    if (pressed && (key === "Enter" || key === " ")) return;
    if (!act(app, play, key, e.shiftKey)) return;
    e.preventDefault();
  });
}

function act(app, play, key, shift) {
  const middle = [app.view.width / 2, app.view.height / 2];
  if (MOVES[key]) {
    const at = app.cursor ?? app.view.toFilm(middle).map(Math.round), by = shift ? 10 : 1;
    app.cursor = [at[0] + by * MOVES[key][0], at[1] + by * MOVES[key][1]];
    app.paint();
  } else if (key === "Enter" && app.cursor) { app.point(app.cursor); app.cursor = null; }
  else if (key === "Escape") { app.cursor = null; app.boxing = null; app.paint(); }
  else if (key === "ArrowLeft") app.go(app.frame - (shift ? 10 : 1));
  else if (key === "ArrowRight") app.go(app.frame + (shift ? 10 : 1));
  else if (key === "Home") app.go(app.first);
  else if (key === "End") app.go(app.last);
  else if (key === " ") play();
  else if (key === "+" || key === "=") { app.view.zoom(1.25, middle); app.paint(); }
  else if (key === "-") { app.view.zoom(0.8, middle); app.paint(); }
  else if (key === "0") { app.view.fitted = true; app.paint(); }
  else if (key === "t") { app.looks = !app.looks; steps.show(app); app.look(); }
  else if (key === "n") nextDoubt(app, 1);
  else if (key === "b") nextDoubt(app, -1);
  else if (key === "m" && app.names.length) app.chooseNode(app.names[(app.names.indexOf(app.node) + 1) % app.names.length]);
  else if (app.step === "check" && key === "x") nothing(app);
  else if (app.step === "check" && key === "z") app.undo();
  else if (app.step === "check" && /^[1-9]$/.test(key)) assign(app, Number(key));
  else return false;
  return true;
}
