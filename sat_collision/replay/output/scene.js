// The bodies at the present time.
const scene = at('scene');
// What is in the middle of the scene, and how many pixels a metre is.
let look = {x: 0, y: 0, scale: 1};

// Convert rings to metres, stored as the differences from the ring before.
function decode(one) {
  if (one.decoded) return;
  one.decoded = true;
  for (const body of one.bodies) {
    let name = '', last = [];
    for (const span of body.spans) {
      name = span[2] = span[2] === null ? name : span[2];
      const [sign, ...numbers] = span[4];
      last = sign ? numbers : numbers.map((value, i) => value + last[i]);
      span[4] = last.map(value => value * one.unit);
    }
  }
}

function spanAt(body, k) {
  let low = 0, high = body.spans.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (body.spans[middle][0] <= k) low = middle + 1; else high = middle;
  }
  const found = body.spans[low - 1];
  return found && k < found[1] ? found : null;
}

// Where a body is at a time: between two moments at which it is known, on the line between.
function placeAt(body, time) {
  const {times} = recording;
  let k = times.findIndex(one => one > time) - 1;
  if (k === -2) k = times.length - 1;
  k = Math.max(k, 0);
  const one = spanAt(body, k), other = k + 1 < times.length ? spanAt(body, k + 1) : null;
  const share = (time - times[k]) / (times[k + 1] - times[k]);
  if (!one) return other && share > 0.5 ? {name: other[2], known: other[3], ring: other[4]} : null;
  const [, , name, known, ring] = one;
  if (!other || one === other || !known || !other[3] || other[4].length !== ring.length ||
      !(share > 0)) return {name, known, ring};
  return {name, known, ring: ring.map((value, i) => value + share * (other[4][i] - value))};
}

function bounds(ring) {
  let low = [Infinity, Infinity], high = [-Infinity, -Infinity];
  ring.forEach((value, i) => {
    low[i % 2] = Math.min(low[i % 2], value);
    high[i % 2] = Math.max(high[i % 2], value);
  });
  return {x: (low[0] + high[0]) / 2, y: (low[1] + high[1]) / 2, low, high,
    size: Math.max(high[0] - low[0], high[1] - low[1])};
}

function bodyOf(footprint) {
  return recording.bodies.find(body => body.footprint === footprint);
}

function pixels() {
  const {clientWidth: width, clientHeight: height} = scene;
  return {width, height, x: x => width / 2 + (x - look.x) * look.scale,
    y: y => height / 2 - (y - look.y) * look.scale};
}

function pathOf(ring, {x, y}) {
  if (ring.length === 2) {
    return `M${x(ring[0]) - 3},${y(ring[1])}a3,3 0 1 0 6,0a3,3 0 1 0 -6,0`;
  }
  return `${lineOf(ring, {x, y})}Z`;
}

function lineOf(places, {x, y}) {
  let path = 'M';
  for (let i = 0; i < places.length; i += 2) {
    path += `${x(places[i]).toFixed(1)},${y(places[i + 1]).toFixed(1)} `;
  }
  return path;
}

function drawScene() {
  const scale = pixels(), {width, height} = scale;
  const drawn = svg('svg', {'aria-hidden': 'true'});
  drawGrid(drawn, scale);
  recording.footprints.forEach(({colour}, k) => {
    const body = bodyOf(k);
    const places = body ? body.spans.map(span => bounds(span[4])) : [];
    if (places.length > 1) {
      drawn.append(svg('path', {class: 'trail', stroke: colour, d: 'M' +
        places.map(one => `${scale.x(one.x).toFixed(1)},${scale.y(one.y).toFixed(1)}`).join('L')}));
    }
  });
  const present = lasting(now);
  const touching = new Set(present.flatMap(one => one.bodies));
  const paths = {known: '', lost: '', met: ''};
  const own = [], named = [];
  recording.bodies.forEach((body, row) => {
    const place = placeAt(body, now);
    if (!place) return;
    if (body.footprint !== null) {
      own.push({...place, row, footprint: body.footprint});
      return;
    }
    const kind = !place.known ? 'lost' : touching.has(row) ? 'met' : 'known';
    paths[kind] += pathOf(place.ring, scale);
    if (kind === 'met') named.push(place);
  });
  drawn.append(svg('path', {class: 'obstacle', d: paths.known}),
    svg('path', {class: 'obstacle lost', d: paths.lost}), svg('path', {class: 'met', d: paths.met}));
  for (const {ring, known, row, footprint} of own) {
    const {colour} = recording.footprints[footprint];
    const state = known ? touching.has(row) ? ' touches' : '' : ' lost';
    drawn.append(svg('path', {class: `footprint${state}`, d: pathOf(ring, scale), stroke: colour,
      fill: colour, 'data-footprint': footprint}));
  }
  recording.plans.filter(one => one.first <= now && now <= one.last)
    .forEach(one => drawPlan(drawn, one, scale));
  present.forEach(one => drawManifold(drawn, one, scale));
  writeNames(drawn, [...own, ...named], scale);
  scene.replaceChildren(drawn);
  scene.setAttribute('aria-label', `${own.length} footprints at ${now.toFixed(3)} s`);
  return [width, height];
}

function drawGrid(drawn, {width, height, x, y}) {
  const reach = [width / 2 / look.scale, height / 2 / look.scale];
  const across = ticks(look.x - reach[0], look.x + reach[0], width / 90);
  const up = ticks(look.y - reach[1], look.y + reach[1], height / 70);
  for (const value of across.found) {
    drawn.append(svg('path', {class: 'grid', d: `M${x(value)},0V${height}`}),
      svg('text', {x: x(value) + 3, y: height - 4}, `${value.toFixed(across.decimals)} m`));
  }
  for (const value of up.found) {
    drawn.append(svg('path', {class: 'grid', d: `M0,${y(value)}H${width}`}),
      svg('text', {x: 3, y: y(value) - 3}, `${value.toFixed(up.decimals)} m`));
  }
}

// Where a contact is deepest: its points, and from each the normal, at least as long as the depth.
function drawManifold(drawn, contact, {x, y}) {
  const [nx, ny] = contact.normal, reach = Math.max(-contact.value, 24 / look.scale);
  // At other times it is faint, for the bodies are elsewhere then.
  const opacity = Math.abs(now - contact.deepest) < 0.05 ? 1 : 0.3;
  const group = svg('g', {class: 'manifold', opacity});
  for (const [px, py] of contact.points) {
    group.append(svg('circle', {cx: x(px), cy: y(py), r: 3}),
      svg('path', {d: `M${x(px)},${y(py)}L${x(px + reach * nx)},${y(py + reach * ny)}`}));
  }
  drawn.append(group);
}

// A plan until it meets an obstacle, and the footprint there.
function drawPlan(drawn, {footprint, way, outline}, scale) {
  if (!way.length) return;
  const {colour} = recording.footprints[footprint];
  drawn.append(svg('path', {class: 'plan', stroke: colour, d: lineOf(way, scale)}),
    svg('path', {class: 'plan contact', d: `${lineOf(outline, scale)}Z`}));
}

// Names of footprints and of what they touch, moved up until none covers another.
function writeNames(drawn, places, {x, y, width, height}) {
  const taken = [];
  for (const {ring, name} of places) {
    const {x: middle, low, high} = bounds(ring);
    if (x(high[0]) < 0 || x(low[0]) > width || y(low[1]) < 0 || y(high[1]) > height) continue;
    const half = 3.9 * name.length;
    let [left, base] = [x(middle), y(high[1]) - 5];
    left = Math.min(Math.max(left, half), width - half);
    while (taken.some(([a, b, reach]) => Math.abs(a - left) < half + reach &&
        Math.abs(b - base) < 13)) base -= 13;
    taken.push([left, base, half]);
    drawn.append(svg('text', {class: 'name halo', x: left, y: base, 'text-anchor': 'middle'}, name));
  }
}

// The visible part of the scene

function fit(x, y, reachX, reachY) {
  look = {x, y, scale: Math.min(scene.clientWidth / 2 / reachX, scene.clientHeight / 2 / reachY)};
}

function lookAtAll() {
  const places = recording.bodies.filter(body => body.footprint !== null)
    .flatMap(body => body.spans.map(span => bounds(span[4])));
  view.value = '';
  if (!places.length) return;
  const low = [0, 1].map(i => least(places.map(one => one.low[i])));
  const high = [0, 1].map(i => most(places.map(one => one.high[i])));
  const size = most(places.map(one => one.size)) || 1;
  fit((low[0] + high[0]) / 2, (low[1] + high[1]) / 2,
    (high[0] - low[0]) / 2 + 0.7 * size, (high[1] - low[1]) / 2 + 0.7 * size);
}

function lookAt(footprint, x, y) {
  const body = bodyOf(footprint);
  const reach = body ? 1.6 * bounds(body.spans[0][4]).size || 1 : 2;
  view.value = String(footprint);
  fit(x, y, reach, reach);
}

// Move the scene as far as the footprint that is followed has moved.
function follow(from, to) {
  const body = view.value === '' ? null : bodyOf(Number(view.value));
  const [one, other] = body ? [placeAt(body, from), placeAt(body, to)] : [null, null];
  if (!one || !other) return;
  const [a, b] = [bounds(one.ring), bounds(other.ring)];
  look.x += b.x - a.x;
  look.y += b.y - a.y;
}

function zoom(factor, left, top) {
  const {width, height} = pixels();
  const x = look.x + (left - width / 2) / look.scale, y = look.y - (top - height / 2) / look.scale;
  look.scale = Math.min(Math.max(look.scale * factor, 1e-3), 1e6);
  look.x = x - (left - width / 2) / look.scale;
  look.y = y + (top - height / 2) / look.scale;
  drawScene();
}

const fingers = new Map();
scene.onpointerdown = event => {
  fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  scene.setPointerCapture(event.pointerId);
};
scene.onpointerup = scene.onpointercancel = event => fingers.delete(event.pointerId);
scene.onpointermove = event => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const place = [event.offsetX, event.offsetY];
  const [other] = [...fingers].filter(([key]) => key !== event.pointerId).map(([, one]) => one);
  fingers.set(event.pointerId, place);
  if (other) {
    const distance = ([x, y]) => Math.hypot(x - other[0], y - other[1]) || 1;
    zoom(distance(place) / distance(before), other[0], other[1]);
    return;
  }
  look.x -= (place[0] - before[0]) / look.scale;
  look.y += (place[1] - before[1]) / look.scale;
  drawScene();
};
scene.addEventListener('wheel', event => {
  event.preventDefault();
  zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY);
}, {passive: false});
view.onchange = () => {
  const k = view.value === '' ? null : Number(view.value);
  const body = k === null ? null : bodyOf(k);
  const place = body && placeAt(body, now);
  if (place) lookAt(k, bounds(place.ring).x, bounds(place.ring).y);
  else if (k === null) lookAtAll();
  drawScene();
};

// Start
scrubber.oninput = () => { stop(); go(Number(scrubber.value)); };
scrubber.onkeydown = timeline.onkeydown = onKey;
at('play').onclick = play;
document.addEventListener('keydown', event => {
  if (event.key !== ' ' || event.target.closest('button, select, a') || !recording.times.length) return;
  event.preventDefault();
  play();
});
if (data.index) {
  at('index').hidden = false;
  at('index').querySelector('.wide').append(table(data.index,
    k => { location.hash = `r=${k + 1}`; }));
}
window.onhashchange = showLinked;
window.onresize = () => {
  if (recording.times.length) { drawTimeline(); drawScene(); }
};
showLinked();
