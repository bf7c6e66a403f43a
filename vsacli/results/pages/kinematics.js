"use strict";
/* Vectors, and the points of a robot at joint positions: DH frames and mounts, as in the package. */
vsacli.kinematics = (() => {
  const add = (a, b, share = 1) => [a[0] + share * b[0], a[1] + share * b[1], a[2] + share * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const scaled = (a, factor) => a.map((each) => factor * each);
  const size = (a) => Math.sqrt(dot(a, a));

  /* A frame has its axes x, y and z and its origin, in the frame around it; `inner` is given in `outer`. */
  const turned = ([x, y, z], [a, b, c]) => add(add(scaled(x, a), y, b), z, c);
  function compose(outer, inner) {
    const [x, y, z, origin] = inner.map((vector) => turned(outer, vector));
    return [x, y, z, add(outer[3], origin)];
  }

  function linkFrame({ a, alpha, d, theta }) {
    const [c, s, ca, sa] = [Math.cos(theta), Math.sin(theta), Math.cos(alpha), Math.sin(alpha)];
    return [[c, s, 0], [-s * ca, c * ca, sa], [s * sa, -c * sa, ca], [a * c, a * s, d]];
  }

  /* The row of a joint at its position. */
  function rowAt({ dh, sliding }, position) {
    return sliding ? { ...dh, d: dh.d + position } : { ...dh, theta: dh.theta + position };
  }

  /* Origins of the DH frames, then of the tools; for each joint the seat at which its row begins, the elbow between its
     offset and its length, and its axis. */
  function pointsOf({ base, joints, tools }, positions) {
    const frames = [base], seats = [], elbows = [];
    joints.forEach((joint, index) => {
      const carrying = frames[joint.carrier], row = rowAt(joint, positions[index]);
      const seat = joint.mount ? compose(carrying, joint.mount) : carrying;
      seats.push(seat);
      elbows.push(add(seat[3], seat[2], row.d));
      frames.push(compose(seat, linkFrame(row)));
    });
    const origins = [...frames, ...tools.map(({ carrier, frame }) => compose(frames[carrier], frame))].map((frame) => frame[3]);
    return { origins, seats: seats.map((seat) => seat[3]), elbows, axes: seats.map((seat) => seat[2]) };
  }

  /* A sphere that no point leaves while positions stay within these ranges. Its middle is where the robot turns: a point
     on the first axis, or the origin of frame 0 if the first joint slides or is not the only one there. */
  function sphere(arm, ranges) {
    const turning = !arm.joints[0].sliding && arm.joints.filter(({ carrier }) => carrier === 0).length === 1;
    const distances = [0];
    arm.joints.forEach((joint, index) => {
      const offset = Math.max(...ranges[index].map((position) => Math.abs(rowAt(joint, position).d)));
      const elbow = distances[joint.carrier] + offset + (joint.mount ? size(joint.mount[3]) : 0);
      if (turning && index === 0) distances[0] = elbow;
      distances.push((turning && index === 0 ? 0 : elbow) + Math.abs(joint.dh.a));
    });
    const ends = arm.tools.map(({ carrier, frame }) => distances[carrier] + size(frame[3]));
    const middle = turning ? pointsOf(arm, ranges.map(([position]) => position)).elbows[0] : arm.base[3];
    return { middle, radius: Math.max(...distances, ...ends) || 1 };
  }

  return { add, dot, cross, scaled, size, pointsOf, sphere };
})();
