"use strict";
/* The robot at the time cursor, or at the positions of sliders: prisms in orthographic view, painted from the back to the front. Up is against gravity. */
vsacli.robot = (() => {
  const { data, state, array, after, color, curveColor } = vsacli;
  const { add, dot, cross, scaled, size, pointsOf, sphere } = vsacli.kinematics;
  const THICK = 0.034, THIN = 0.014;  // radii of joints and links, relative to the size of the motion
  const SHORTEST = 0.3;  // share of its length below which the arrow of gravity is left out
  const ISOMETRIC = { turn: -0.75 * Math.PI, tilt: 0.6155 };
  const view = { ...ISOMETRIC };
  const canvas = document.getElementById("arm"), note = document.getElementById("arm-note");
  const arms = data.files ? data.files.map((file) => file.arm).map(unpacked).filter(Boolean) : [];
  const joints = data.joints || [];
  const down = (arms.find((arm) => size(arm.down) > 0) || { down: [0, 0, 0] }).down;
  const frame = level(size(down) > 0 ? scaled(down, -1) : [0, 0, 1]);
  const box = bounds();

  /* An arm with its positions over time, if it moves, and the origins of its frames at each instant, those of the tools
     last. */
  function unpacked(arm, file) {
    if (!arm) return null;
    if (arm.motion === null) return { ...arm, file, passed: [] };
    const time = array(arm.motion.time), q = array(arm.motion.q), count = arm.joints.length;
    const motion = Array.from(time, (_, instant) => q.subarray(instant * count, (instant + 1) * count));
    return { ...arm, file, time, motion, passed: motion.map((positions) => pointsOf(arm, positions).origins) };
  }

  /* Upright unit vector, and two level ones: of a base frame that stands upright its axes x and y. */
  function level(up) {
    const x = Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], ahead = add(x, up, -dot(x, up));
    const first = scaled(ahead, 1 / size(ahead));
    return { first, second: cross(up, first), up };
  }

  /* Middle and radius of all points that any arm passes, and the height of the lowest; without a motion, of all that
     sliders reach, and the height of the base. */
  function bounds() {
    const still = arms.find((arm) => arm.motion === null);
    if (still) return { ...sphere(still, joints.map(({ range }) => range)), lowest: dot(still.base[3], frame.up) };
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    let lowest = Infinity;
    for (const point of arms.flatMap(({ passed }) => passed.flat())) {
      const height = dot(point, frame.up);
      if (height < lowest) lowest = height;
      point.forEach((value, axis) => {
        if (value < low[axis]) low[axis] = value;
        if (value > high[axis]) high[axis] = value;
      });
    }
    const middle = low.map((value, axis) => (value + high[axis]) / 2);
    return { middle, radius: Math.hypot(...low.map((value, axis) => (high[axis] - value) / 2)) || 1, lowest };
  }

  /* Points of an arm now: at the cursor with positions linear between instants, without a motion at those of sliders. */
  function pointsNow(arm) {
    if (arm.motion === null) return pointsOf(arm, state.positions);
    const next = Math.min(Math.max(after(arm.time, state.cursor), 1), arm.time.length - 1), before = Math.max(next - 1, 0);
    const span = arm.time[next] - arm.time[before];
    const share = span > 0 ? Math.min(Math.max((state.cursor - arm.time[before]) / span, 0), 1) : 0;
    return pointsOf(arm, arm.motion[before].map((value, joint) => value + share * (arm.motion[next][joint] - value)));
  }

  function camera() {
    const { width, height } = canvas;
    const [c, s, ct, st] = [Math.cos(view.turn), Math.sin(view.turn), Math.cos(view.tilt), Math.sin(view.tilt)];
    const inBase = ([x, y, z]) => add(add(scaled(frame.first, x), frame.second, y), frame.up, z);
    const right = inBase([-s, c, 0]), up = inBase([-c * st, -s * st, ct]), towards = inBase([c * ct, s * ct, st]);
    const scale = 0.49 * Math.min(width, height) / (box.radius * (1 + THICK));
    const flat = (point) => {
      const from = add(point, box.middle, -1);
      return [width / 2 + scale * dot(from, right), height / 2 - scale * dot(from, up)];
    };
    return { flat, up, towards };
  }

  /* The faces of a prism from one point to another, each with its depth and how bright it is. */
  function prism(from, to, radius, sides, paint, faces, eye) {
    const axis = add(to, from, -1), length = size(axis);
    if (!(length > 1e-9)) return;
    const along = scaled(axis, 1 / length);
    const aside = cross(along, Math.abs(along[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0]);
    const u = scaled(aside, radius / size(aside)), v = cross(along, u);
    const ring = (center) => Array.from({ length: sides }, (_, side) => {
      const angle = 2 * Math.PI * (side + 0.5) / sides;
      return add(add(center, u, Math.cos(angle)), v, Math.sin(angle));
    });
    const [first, last] = [ring(from), ring(to)];
    const face = (corners, normal) => {
      if (dot(normal, eye.towards) <= 0) return;
      const center = scaled(corners.reduce((sum, corner) => add(sum, corner), [0, 0, 0]), 1 / corners.length);
      faces.push({ corners, depth: dot(center, eye.towards), bright: 0.62 + 0.38 * dot(normal, eye.towards) / size(normal), paint });
    };
    for (let side = 0; side < sides; side += 1) {
      const next = (side + 1) % sides;
      face([first[side], first[next], last[next], last[side]], add(add(first[side], first[next]), from, -2));
    }
    face(first, scaled(along, -1));
    face(last, along);
  }

  const inside = (spans) => spans.some(([start, end]) => start <= state.cursor && state.cursor <= end);

  /* What is wrong with a joint now, worst first. */
  function trouble(file, joint) {
    const { troubles } = data.files[file];
    return Object.keys(troubles).filter((kind) => inside(troubles[kind][joint]));
  }

  function armFaces(arm, { origins, seats, elbows, axes }, eye) {
    const faces = [], radius = box.radius;
    const link = { fill: color("soft") };
    const [base, upright] = [origins[0], axes[0]];  // the plate stands across the first axis
    prism(add(base, upright, -2.4 * THICK * radius), add(base, upright, -THICK * radius), 2 * THICK * radius, 4, link, faces, eye);
    arm.joints.forEach(({ carrier, sliding }, joint) => {
      const bad = trouble(arm.file, joint)[0];
      const paint = { fill: bad ? color("bad") : curveColor(joint) }, wide = THICK * radius * (bad ? 1.35 : 1);
      const here = seats[joint], sleeve = scaled(axes[joint], 1.3 * THICK * radius);
      prism(add(here, sleeve, -1), add(here, sleeve), sliding ? 1.2 * wide : wide, sliding ? 4 : 18, paint, faces, eye);
      prism(origins[carrier], here, THIN * radius, 10, link, faces, eye);
      prism(here, elbows[joint], (sliding ? 0.75 : 1) * THIN * radius, sliding ? 4 : 10, sliding ? paint : link, faces, eye);
      prism(elbows[joint], origins[joint + 1], THIN * radius, 10, link, faces, eye);
    });
    arm.tools.forEach(({ carrier }, tool) => {
      prism(origins[carrier], origins[toolPoint(arm, tool)], 0.6 * THIN * radius, 8, link, faces, eye);
    });
    return faces;
  }

  const toolPoint = (arm, tool) => arm.joints.length + 1 + tool;  // among the origins

  function shaded(fill, bright) {
    const [r, g, b] = fill.match(/[0-9a-f]{2}/gi).map((pair) => parseInt(pair, 16));
    const lifted = (part) => Math.round(bright * (0.8 * part + 40));
    return `rgb(${lifted(r)},${lifted(g)},${lifted(b)})`;
  }

  function path(context, corners, flat) {
    context.beginPath();
    corners.map(flat).forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
  }

  /* Height of the ground: all of the motion is above it, and the plate of a base that stands at the bottom is on it. */
  const ground = () => box.lowest - 2.4 * THICK * box.radius;

  function drawGround(context, flat) {
    const { middle, radius } = box, step = radius / 3;
    const center = add(middle, frame.up, ground() - dot(middle, frame.up));
    context.strokeStyle = color("line");
    context.lineWidth = devicePixelRatio;
    for (let line = -3; line <= 3; line += 1) {
      for (const [a, b] of [[[line, -3], [line, 3]], [[-3, line], [3, line]]]) {
        path(context, [a, b].map(([x, y]) => add(add(center, frame.first, x * step), frame.second, y * step)), flat);
        context.stroke();
      }
    }
  }

  const LARGEST = 4;  // pixels, of a unit of lettering

  /* Unit of texts and of the arrow of gravity, which grow with the picture up to the size of texts around it. */
  const lettering = () => Math.min(0.01 * Math.min(canvas.width, canvas.height), LARGEST * devicePixelRatio);

  /* The direction of gravity, unless it is seen from its end. */
  function drawGravity(context, eye) {
    const unit = lettering(), length = -12 * unit * dot(down, eye.up);
    if (length < SHORTEST * 12 * unit) return;
    const x = 7 * unit, start = 5 * unit, end = start + length;
    context.strokeStyle = context.fillStyle = color("ink");
    context.lineWidth = 1.5 * devicePixelRatio;
    for (const [draw, corners] of [["stroke", [[x, start], [x, end]]], ["fill", [[x, end], [x - unit, end - 3 * unit], [x + unit, end - 3 * unit]]]]) {
      path(context, corners, (corner) => corner);
      context[draw]();
    }
    context.font = `${4 * unit}px system-ui, sans-serif`;
    context.textAlign = "left";
    context.fillText("g", x + 2 * unit, end);
  }

  function drawTrace(context, arm, point, flat) {
    path(context, arm.passed.map((origins) => origins[point]).filter((place) => place.every(Number.isFinite)), flat);
    context.strokeStyle = color("accent");
    context.lineWidth = 1.2 * devicePixelRatio;
    context.stroke();
  }

  /* Names of several tools, next to them. */
  function drawNames(context, arm, origins, flat) {
    if (arm.tools.length < 2) return;
    const unit = lettering();
    context.fillStyle = color("ink");
    context.font = `${3.2 * unit}px system-ui, sans-serif`;
    arm.tools.forEach(({ name }, tool) => {
      const [x, y] = flat(origins[toolPoint(arm, tool)]);
      const outside = x + 1.5 * unit + context.measureText(name).width > canvas.width;
      context.textAlign = outside ? "right" : "left";
      context.fillText(name, x + (outside ? -1.5 : 1.5) * unit, y - 1.5 * unit);
    });
  }

  function draw() {
    if (!arms.length) return;
    const wanted = Math.round(canvas.clientWidth * devicePixelRatio);
    if (canvas.width !== wanted || canvas.height !== Math.round(canvas.clientHeight * devicePixelRatio)) {
      canvas.width = wanted;
      canvas.height = Math.round(canvas.clientHeight * devicePixelRatio);
    }
    const context = canvas.getContext("2d"), eye = camera();
    context.clearRect(0, 0, canvas.width, canvas.height);
    context.lineJoin = "round";
    drawGround(context, eye.flat);
    arms.filter((arm) => state.files.has(arm.file)).forEach((arm, order) => {
      context.globalAlpha = order ? 0.45 : 1;
      const points = pointsNow(arm);
      arm.tools.forEach((_, tool) => drawTrace(context, arm, toolPoint(arm, tool), eye.flat));
      for (const { corners, bright, paint } of armFaces(arm, points, eye).sort((a, b) => a.depth - b.depth)) {
        path(context, corners, eye.flat);
        context.closePath();
        context.fillStyle = context.strokeStyle = shaded(paint.fill, bright);
        context.lineWidth = 0.6;
        context.fill();
        context.stroke();
      }
      drawNames(context, arm, points.origins, eye.flat);
    });
    context.globalAlpha = 1;
    drawGravity(context, eye);
    tellTroubles();
  }

  function tellTroubles() {
    const said = arms.flatMap((arm) => joints.map((joint, at) => [joint.name, trouble(arm.file, at)]));
    const bad = said.filter(([, kinds]) => kinds.length).map(([name, kinds]) => `${name}: ${kinds.join(", ")}`);
    note.classList.toggle("hint", !bad.length);
    note.textContent = bad.length ? bad.join("; ") : "drag, or arrow keys, turn the view; double-click resets it";
  }

  let waiting = false;
  function drawSoon() {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; draw(); });
  }

  function turn(aside, upward) {
    view.turn -= aside;
    view.tilt = Math.min(Math.max(view.tilt + upward, -Math.PI / 2), Math.PI / 2);
    drawSoon();
  }

  function follow() {
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) turn(0.01 * event.movementX, 0.01 * event.movementY);
    });
    canvas.addEventListener("dblclick", () => { Object.assign(view, ISOMETRIC); drawSoon(); });
    canvas.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!way) return;
      turn(0.1 * way[0], 0.1 * way[1]);
      event.preventDefault();
      event.stopPropagation();
    });
    new ResizeObserver(drawSoon).observe(canvas);
    ["cursor", "pose", "shown", "scheme"].forEach((topic) => vsacli.listen(topic, drawSoon));
    ["paper", "screen"].forEach((topic) => vsacli.listen(topic, draw));
  }

  if (arms.length) {
    document.getElementById("robot").hidden = false;
    document.getElementById("columns").classList.add("beside");
    follow();
  }
  return { arms, pointsNow, draw, view, down, eye: camera, ground };
})();
