"use strict";
/* What the parts of a page share: its numbers, its colors, and the state that all of them follow. */
const vsacli = (() => {
  const data = JSON.parse(document.getElementById("page-data").textContent);
  const decoded = new Map();
  const listeners = new Map();

  /* An array by its number, decoded when it is first asked for. */
  function array(number) {
    if (!decoded.has(number)) {
      const text = atob(document.getElementById(`array-${number}`).textContent);
      const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
      decoded.set(number, new Float32Array(bytes.buffer));
    }
    return decoded.get(number);
  }

  /* The first index whose time is later. */
  function after(times, time) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle + 1; else high = middle;
    }
    return low;
  }

  /* The value of a curve at a time, linear between its points; NaN outside it and in its gaps. */
  function valueAt(times, values, time) {
    const next = after(times, time);
    if (next === 0) return NaN;
    const before = next - 1;
    if (times[before] === time || next === times.length) {
      return times[before] === time ? values[before] : NaN;
    }
    const share = (time - times[before]) / (times[next] - times[before]);
    return values[before] + share * (values[next] - values[before]);
  }

  /* Six digits, as a cursor shows them. */
  function number(value) {
    if (!Number.isFinite(value)) return "–";
    const size = Math.abs(value);
    return size !== 0 && (size >= 1e6 || size < 1e-3) ? value.toExponential(3) : String(Number(value.toPrecision(6)));
  }

  /* A color of the scheme; `names` finds it again when a plot is copied in the colors of paper. */
  const names = new Map();
  function color(name) {
    const value = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim().toLowerCase();
    names.set(value, name);
    return value;
  }

  /* The color of paper that stands for one of the screen, given as #rrggbb or rgb(r, g, b); others stay. */
  function onPaper(value) {
    const parts = value.match(/^rgb\((\d+),\s*(\d+),\s*(\d+)\)$/)?.slice(1);
    const hex = parts ? `#${parts.map((part) => Number(part).toString(16).padStart(2, "0")).join("")}` : value.toLowerCase();
    return names.has(hex) ? color(names.get(hex)) : value;
  }

  const COLORS = 8;
  const curveColor = (index) => color(`curve-${index % COLORS}`);
  const named = (index) => `var(--curve-${index % COLORS})`;  // which follows the scheme by itself

  /* An element with texts that are only ever texts. */
  function element(tag, attributes = {}, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name === "class") made.className = value; else made.setAttribute(name, value);
    }
    made.append(...children);
    return made;
  }

  const state = {
    window: data.span ? [...data.span] : [0, 1],
    cursor: data.span ? data.span[0] : 0,
    positions: (data.joints || []).map(({ home }) => home),
    joints: new Set((data.joints || []).keys()),
    files: new Set((data.files || []).keys()),
  };

  /* Call a function whenever something changes: "window", "cursor", "pose", "shown", "scheme", "reset"; and when the
     page goes to "paper" or comes back to the "screen". */
  function listen(topic, heard) {
    if (!listeners.has(topic)) listeners.set(topic, []);
    listeners.get(topic).push(heard);
  }

  function tell(topic, ...details) {
    for (const heard of listeners.get(topic) || []) heard(...details);
  }

  function setCursor(time) {
    state.cursor = Math.min(Math.max(time, data.span[0]), data.span[1]);
    tell("cursor");
  }

  const SHORTEST = 1e-6;  // of a window, relative to all: single precision tells no two times closer apart

  function setWindow(start, end, source) {
    const [first, last] = data.span;
    const length = Math.min(Math.max(end - start, SHORTEST * (last - first)), last - first);
    const from = Math.min(Math.max(start, first), last - length);
    state.window = [from, from + length];
    tell("window", source);
  }

  const shown = (series) => (series.joint === null || state.joints.has(series.joint)) && state.files.has(series.file);

  const dark = matchMedia("(prefers-color-scheme: dark)"), root = document.documentElement.classList;
  root.toggle("dark", dark.matches);
  dark.addEventListener("change", () => { root.toggle("dark", dark.matches); tell("scheme"); });
  /* Canvases keep their colors on paper, unlike all that the style sheet colors: they are drawn again, which must be
     done when the listener returns, since the browser prints then. */
  addEventListener("beforeprint", () => { root.add("on-paper"); tell("paper"); });
  addEventListener("afterprint", () => { root.remove("on-paper"); tell("screen"); });
  return { data, state, array, after, valueAt, number, color, curveColor, named, onPaper, COLORS, element,
           listen, tell, setCursor, setWindow, shown };
})();
