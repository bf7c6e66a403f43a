"use strict";
/* Figures of the library in the page's colors, and what is drawn into them: curves, their bands, stretches of time. */
Bokeh.set_log_level("warn");
vsacli.figures = (() => {
  const { data, state, array, color, curveColor, onPaper } = vsacli;
  /* Dashes of a curve, and the border that stands for them in a legend. */
  const DASHES = [["solid", "solid"], ["dashed", "dashed"], ["dotdash", "double"], ["dotted", "dotted"]];

  /* Joints have colors; what is beyond those, other files and other roles have other dashes. */
  function dash(series) {
    const roles = { commanded: 1, measured: 3 };
    return DASHES[(roles[series.role] || series.file + Math.floor(series.color / vsacli.COLORS)) % DASHES.length];
  }

  function absolute(times) {
    return Float64Array.from(times, (time) => time + data.start);
  }

  /* Failures of a joint that plots mark, each above those before it. */
  const FAILURES = ["near-singular", "infeasible", "singular"];
  const OPACITY = { unreliable: 0.18, "near-singular": 0.25, infeasible: 0.35, singular: 0.6 };  // of areas behind curves
  const IN_STRIPS = { "near-singular": 0.4, infeasible: 1, singular: 1 };
  const STRIP = 0.03;  // height of a strip, relative to the plot

  /* Intervals of a kind at a joint, or at the ends of recordings, in any file that is shown; overlapping ones merged. */
  function stretches(kind, joint) {
    const every = data.files.filter((_, file) => state.files.has(file))
      .flatMap((file) => (kind === "unreliable" ? file.unreliable : (file.troubles[kind] || [])[joint] || []))
      .map((span) => [...span]);
    const merged = [];
    for (const [start, end] of every.sort((one, other) => one[0] - other[0])) {
      const last = merged.at(-1);
      if (last && start <= last[1]) last[1] = Math.max(last[1], end); else merged.push([start, end]);
    }
    return merged;
  }

  /* Areas to mark in a plot of some curves, from and to shares of its height. Failures of the only curve are behind it;
     those of one of several joints are in a strip below, in its color: over the full height, all joints would look
     infeasible. */
  function areasOf(series) {
    const curves = new Set(series.map(({ joint, file }) => `${joint} ${file}`));
    const joints = [...new Set(series.map(({ joint }) => joint))].filter((joint) => joint !== null);
    const failing = joints.map((joint) => FAILURES.flatMap((kind) => stretches(kind, joint).map((span) => ({ kind, joint, span }))))
      .filter((found) => found.length);
    const strips = curves.size > 1 ? failing.length : 0;
    const marked = failing.flatMap((found, at) => found.map(({ kind, joint, span }) => (strips
      ? { kind, span, paint: curveColor(joint), opacity: IN_STRIPS[kind], from: (strips - at - 0.9) * STRIP, to: (strips - at - 0.1) * STRIP }
      : { kind, span, paint: color(kind), opacity: OPACITY[kind], from: 0, to: 1 })));
    const ends = stretches("unreliable").map((span) => (
      { kind: "unreliable", span, paint: color("unreliable"), opacity: OPACITY.unreliable, from: 0, to: 1 }));
    return { strips, areas: [...ends, ...marked] };
  }

  /* Add what draws areas, before any curve; return a function that places them in the range of values that is shown. */
  function addAreas(figure) {
    const columns = ["left", "right", "bottom", "top", "paint", "opacity"];
    const looks = [
      { fill_color: { field: "paint" }, fill_alpha: { field: "opacity" }, line_color: { field: "paint" }, line_alpha: { field: "opacity" } },
      { fill_alpha: 0, line_alpha: 0, hatch_pattern: "right_diagonal_line", hatch_color: { field: "paint" }, hatch_alpha: { field: "opacity" }, hatch_scale: 8 },
    ];
    const sources = looks.map((look) => {
      const source = new Bokeh.ColumnDataSource({ data: Object.fromEntries(columns.map((name) => [name, []])) });
      const places = Object.fromEntries(columns.slice(0, 4).map((name) => [name, { field: name }]));
      figure.quad({ ...places, source, ...look });
      return source;
    });
    return (areas) => {
      const { start, end } = figure.y_range;
      const rows = areas.map(({ kind, span, paint, opacity, from, to }) => ({
        kind, paint, opacity, left: span[0] + data.start, right: span[1] + data.start,
        bottom: start + from * (end - start), top: start + to * (end - start) }));
      sources.forEach((source, hatched) => {
        const chosen = rows.filter(({ kind }) => (kind === "singular") === Boolean(hatched));
        source.data = Object.fromEntries(columns.map((name) => [name, chosen.map((row) => row[name])]));
      });
    };
  }

  /* Put a copy of a figure in the colors of paper into its place, as lines that may be scaled, and return it. */
  function copyForPaper(view, place) {
    const { canvas: copy } = view.export("svg", false), { width, height } = view.bbox;
    for (const node of copy.querySelectorAll("*")) {
      for (const name of ["fill", "stroke"]) {
        if (node.hasAttribute(name)) node.setAttribute(name, onPaper(node.getAttribute(name)));
      }
    }
    copy.setAttribute("viewBox", `0 0 ${width} ${height}`);
    copy.setAttribute("class", "copy");
    place.append(copy);
    place.classList.add("copied");
  }

  function removeCopy(place) {
    place.querySelector(":scope > .copy")?.remove();
    place.classList.remove("copied");
  }

  /* Runs of points between gaps, as index pairs; single points are what a line would not show. */
  function runs(values) {
    const found = [];
    let start = -1;
    for (let index = 0; index <= values.length; index += 1) {
      const there = index < values.length && !Number.isNaN(values[index]);
      if (there && start < 0) start = index;
      if (!there && start >= 0) { found.push([start, index]); start = -1; }
    }
    return found;
  }

  function addBand(figure, series, x, fill) {
    const [lower, upper] = series.band.map(array);
    const summed = lower.map((value, index) => value + upper[index]);
    return runs(summed).filter(([start, end]) => end - start > 1).map(([start, end]) => {
      const [part, y1, y2] = [x, lower, upper].map((each) => each.slice(start, end));
      const source = new Bokeh.ColumnDataSource({ data: { x: part, y1, y2 } });
      const look = { fill_color: fill, fill_alpha: 0.3, level: "underlay" };
      return figure.varea({ field: "x" }, { field: "y1" }, { field: "y2" }, { source, ...look });
    });
  }

  function addSeries(figure, series, bandColor) {
    const x = absolute(array(series.time)), y = array(series.values);
    const look = { line_color: curveColor(series.color), line_width: series.role === "measured" ? 1 : 1.7,
                   line_dash: dash(series)[0] };
    const source = new Bokeh.ColumnDataSource({ data: { x, y } });
    const drawn = [figure.line({ field: "x" }, { field: "y" }, { source, ...look })];
    const alone = runs(y).filter(([start, end]) => end - start === 1).map(([start]) => start);
    if (alone.length) {
      drawn.push(figure.scatter(alone.map((at) => x[at]), alone.map((at) => y[at]),
                                { size: 3, line_color: look.line_color, fill_color: look.line_color }));
    }
    if (series.band) drawn.push(...addBand(figure, series, x, bandColor || look.line_color));
    return { series, drawn };
  }

  function paint(figure) {
    for (const axis of [...figure.xaxes, ...figure.yaxes]) {
      axis.setv({ axis_line_color: color("line"), major_tick_line_color: color("line"), minor_tick_line_color: null,
                  major_label_text_color: color("soft"), axis_label_text_color: color("soft"),
                  axis_label_text_font_style: "normal", axis_label_text_font_size: "12px" });
    }
    for (const grid of [...figure.xgrids, ...figure.ygrids]) grid.grid_line_color = color("grid");
    figure.setv({ background_fill_color: color("card"), border_fill_color: color("card"), outline_line_color: null });
  }

  /* A figure in the page's colors, its labels taken literally. */
  function newFigure(attributes, labels) {
    const figure = Bokeh.Plotting.figure({ sizing_mode: "stretch_both", tools: [], min_border_right: 12,
                                           lod_threshold: null, ...attributes });
    figure.toolbar.autohide = true;
    figure.toolbar.logo = null;
    figure.xaxes[0].axis_label = new Bokeh.PlainText({ text: labels[0] });
    figure.yaxes[0].axis_label = new Bokeh.PlainText({ text: labels[1] });
    paint(figure);
    return figure;
  }

  function addTools(figure) {
    const tools = [new Bokeh.BoxZoomTool({ dimensions: "auto" }), new Bokeh.PanTool(),
                   new Bokeh.WheelZoomTool({ modifiers: { ctrl: true } }), new Bokeh.SaveTool()];
    figure.toolbar.setv({ tools, active_drag: tools[0], active_scroll: tools[2] });
  }

  return { DASHES, FAILURES, IN_STRIPS, STRIP, dash, addSeries, areasOf, addAreas, newFigure, addTools, copyForPaper, removeCopy };
})();
