"use strict";
/* The plots over time: each a card with a legend that shows the values at the cursor; one window of time for all. */
vsacli.charts = (() => {
  const { data, state, array, valueAt, number, color, curveColor, element } = vsacli;
  const { dash, addSeries, shade, newFigure, addTools } = vsacli.figures;
  const NEAR = 0.5, ROOM = 0.06;  // how far limits may be from curves to be shown, and room left; in heights of the curves
  const MANY = 8;  // joints, from which on a legend scrolls
  const cards = [];

  class Card {
    constructor(chart) {
      this.chart = chart;
      this.plot = element("div", { class: "plot" });
      this.values = [];
      this.keys = [...new Set(chart.series.map((series) => series.label))].map((label) => this.key(label));
      const legend = element("div", { class: this.keys.length > MANY ? "legend long" : "legend" }, ...this.keys);
      if (chart.limits.length) legend.append(element("span", { class: "key" }, element("i", { class: "swatch limit" }), "limit"));
      if (chart.band) {
        this.area = element("span", { class: "area" });
        legend.append(element("span", { class: "key" }, this.area, chart.band));
      }
      if (chart.note) legend.append(element("span", { class: "note" }, chart.note));
      this.node = element("figure", { class: "chart" },
        element("figcaption", {}, chart.title, " ", element("code", {}, chart.name)), this.plot, legend);
      this.node.card = this;
    }

    /* What the legend says of a joint: each of its curves, by dashes and role, with the value at the cursor. */
    key(label) {
      const box = element("span", { class: "key" }, `${label} `);
      for (const series of this.chart.series.filter((each) => each.label === label)) {
        const swatch = element("i", { class: "swatch" }), value = element("b"), role = ["computed", label].includes(series.role) ? "" : series.role;
        const rms = series.rms === null ? "" : `rms ${number(series.rms)}, now `;
        const part = element("span", { class: "key", title: data.files[series.file].label }, swatch, role, rms, value);
        this.values.push({ series, swatch, value, part });
        box.append(part);
      }
      return box;
    }

    /* The corridor has a color of its own; uncertainty that of its curve. */
    get bandColor() {
      return this.chart.name === "stiffness" ? color("reachable") : "";
    }

    get visible() {
      const box = this.node.getBoundingClientRect();
      return box.width > 0 && box.bottom > -200 && box.top < innerHeight + 200;
    }

    async build() {
      if (this.figure || this.node.offsetParent === null) return;
      const [start, end] = state.window.map((time) => time + data.start);
      const ranges = { x_range: new Bokeh.Range1d({ start, end }), y_range: new Bokeh.Range1d(this.extent()) };
      this.figure = newFigure(ranges, ["time [s]", `[${this.chart.unit}]`]);
      addTools(this.figure);
      this.shadeAll();
      this.curves = this.chart.series.map((series) => addSeries(this.figure, series, this.bandColor));
      this.addLimits();
      this.span = new Bokeh.Span({ dimension: "height", location: state.cursor + data.start,
                                   line_color: color("cursor"), line_width: 1 });
      this.figure.add_layout(this.span);
      this.follow();
      this.show();
      await Bokeh.Plotting.show(this.figure, this.plot);
      this.update();
    }

    shadeAll() {
      const joints = new Set(this.chart.series.map((series) => series.joint ?? -1));
      if (joints.has(-1)) data.joints.forEach((_, joint) => joints.add(joint));
      shade(this.figure, "unreliable", joints, { fill_alpha: 0.18 });
      shade(this.figure, "near-singular", joints, { fill_alpha: 0.25 });
      shade(this.figure, "infeasible", joints, { fill_alpha: 0.35 });
      shade(this.figure, "singular", joints, { fill_alpha: 0.0, hatch_pattern: "right_diagonal_line",
                                               hatch_color: color("singular"), hatch_alpha: 0.6, hatch_scale: 8 });
    }

    /* What the axis of values shows at first: all curves that are not hidden, and limits that are near them. */
    extent() {
      if (this.chart.shown) return { start: this.chart.shown[0], end: this.chart.shown[1] };
      let low = Infinity, high = -Infinity;
      for (const series of this.chart.series.filter(vsacli.shown)) {
        for (const value of array(series.values)) {
          if (value < low) low = value;
          if (value > high) high = value;
        }
      }
      if (low > high) return { start: 0, end: 1 };
      const height = high - low || Math.abs(high) || 1;
      const near = this.chart.limits.filter(({ joint, value }) => (joint === null || state.joints.has(joint))
        && value > low - NEAR * height && value < high + NEAR * height).map(({ value }) => value);
      return { start: Math.min(low, ...near) - ROOM * height, end: Math.max(high, ...near) + ROOM * height };
    }

    addLimits() {
      this.limits = this.chart.limits.map(({ joint, value }) => ({ joint, line: this.figure.hspan([value], {
        line_color: joint === null ? color("soft") : curveColor(joint), line_dash: "dotted", line_width: 1.2 }) }));
    }

    follow() {
      const x = this.figure.x_range;
      x.change.connect(() => {
        const [start, end] = state.window.map((time) => time + data.start);
        if (x.start !== start || x.end !== end) vsacli.setWindow(x.start - data.start, x.end - data.start, this);
      });
      this.figure.on_event("mousemove", (event) => vsacli.setCursor(event.x - data.start));
      this.figure.on_event("doubletap", () => vsacli.tell("reset"));
    }

    /* Take over window, cursor and values, if there is somebody to see it. */
    update() {
      if (!this.visible) return;
      this.values.forEach(({ series, value }) => {
        value.textContent = number(valueAt(array(series.time), array(series.values), state.cursor));
      });
      if (!this.figure) return;
      const [start, end] = state.window.map((time) => time + data.start);
      const x = this.figure.x_range;
      if (x.start !== start || x.end !== end) x.setv({ start, end });
      this.span.location = state.cursor + data.start;
    }

    reset() {
      if (this.figure) this.figure.y_range.setv(this.extent());
    }

    /* Hide what the filters hide. */
    show() {
      if (this.area) this.area.style.background = this.bandColor || color("soft");
      this.values.forEach(({ series, part, swatch }) => {
        part.classList.toggle("hidden", !vsacli.shown(series));
        swatch.style.borderTopColor = vsacli.named(series.color);
        swatch.style.borderTopStyle = dash(series)[1];
      });
      this.keys.forEach((key) => key.classList.toggle("hidden", !key.querySelector(".key:not(.hidden)")));
      for (const { series, drawn } of this.curves || []) drawn.forEach((each) => { each.visible = vsacli.shown(series); });
      for (const { joint, line } of this.limits || []) line.visible = joint === null || state.joints.has(joint);
      this.reset();
    }

    fail(error) {
      console.error(error);
      this.plot.textContent = `cannot be drawn: ${error.message}`;
    }

    drop() {
      this.plot.replaceChildren();
      this.figure = undefined;
    }
  }

  function add(parent, charts) {
    const made = charts.map((chart) => new Card(chart));
    made.forEach((card) => { parent.append(card.node); card.show(); watcher.observe(card.node); });
    cards.push(...made);
  }

  /* Plots are built one after the other, so that the first is there soon. */
  let first = true, queue = Promise.resolve();
  function build(card) {
    queue = queue.then(() => card.build()).catch((error) => card.fail(error)).then(() => {
      if (first && card.figure) performance.mark("first plot");
      first = first && !card.figure;
      return new Promise((done) => { setTimeout(done, 0); });
    });
    return queue;
  }

  const watcher = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (isIntersecting) build(target.card).then(() => target.card.update());
    }
  }, { rootMargin: "300px" });

  /* Whatever is open but out of sight, while nothing else is to be done: it may be printed. */
  async function buildRest() {
    for (const card of cards) {
      if (!card.figure && card.node.offsetParent !== null) await build(card);
    }
    document.documentElement.dataset.ready = "yes";
  }

  let waiting = false;
  function updateSoon() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; cards.forEach((card) => card.update()); });
  }
  vsacli.listen("cursor", updateSoon);
  vsacli.listen("window", updateSoon);
  vsacli.listen("shown", () => cards.forEach((card) => card.show()));
  vsacli.listen("reset", () => { cards.forEach((card) => card.reset()); vsacli.setWindow(...data.span); });
  vsacli.listen("scheme", () => { cards.forEach((card) => { card.drop(); card.show(); }); buildRest(); });
  addEventListener("scroll", updateSoon, { passive: true });
  return { add, buildRest, cards };
})();
