// The bodies at a moment.

function spanAt(body, k) {
  let low = 0, high = body.spans.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (body.spans[middle][0] <= k) low = middle + 1; else high = middle;
  }
  const found = body.spans[low - 1];
  return found && k < found[1] ? found : null;
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

function footprintBody(k) {
  return recording.bodies.find(body => body.footprint === k);
}

function path() {
  return {x: [], y: [], text: [], textposition: []};
}

function write(names, name, x, y, position) {
  names.x.push(x);
  names.y.push(y);
  names.text.push(name);
  names.textposition.push(`${position} center`);
}

function add(shape, [, , name, , ring]) {
  for (let i = 0; i <= ring.length; i += 2) {
    shape.x.push(ring[i % ring.length]);
    shape.y.push(ring[(i + 1) % ring.length]);
    shape.text.push(name);
  }
  shape.x.push(null);
  shape.y.push(null);
  shape.text.push('');
}

function lasting(k) {
  return recording.contacts.filter(one => one.first <= k && k < one.end);
}

// The names of footprints and of what they touch, one above and one below a pair.
function namesAt(k) {
  const names = path();
  const below = new Set();
  for (const {bodies: [own, other]} of lasting(k)) {
    const spans = [own, other].map(row => row !== undefined && spanAt(recording.bodies[row], k));
    if (!spans[0] || !spans[1]) continue;
    const [a, b] = spans.map(span => bounds(span[4]));
    const isAbove = b.y > a.y;
    if (isAbove) below.add(own);
    const near = (axis, value) => Math.min(Math.max(value, b.low[axis]), b.high[axis]);
    const y = isAbove ? Math.min(b.high[1], a.y + 1.35 * a.size) :
      Math.max(b.low[1], a.y - 1.35 * a.size);
    write(names, spans[1][2], near(0, a.x), y, isAbove ? 'top' : 'bottom');
  }
  recording.bodies.forEach((body, row) => {
    const span = body.footprint !== null && spanAt(body, k);
    if (!span) return;
    const {x, low, high} = bounds(span[4]);
    if (below.has(row)) write(names, span[2], x, low[1], 'bottom');
    else write(names, span[2], x, high[1], 'top');
  });
  return names;
}

// Shapes of obstacles by what is known of them, and the outline of each footprint.
function shapesAt(k) {
  const touching = new Set(lasting(k).flatMap(one => one.bodies));
  const [known, lost, met, points] = [path(), path(), path(), path()];
  const outlines = recording.footprints.map(() => ({...path(), known: true, touches: false}));
  recording.bodies.forEach((body, row) => {
    const span = spanAt(body, k);
    if (!span) return;
    if (body.footprint !== null) {
      add(outlines[body.footprint], span);
      Object.assign(outlines[body.footprint], {known: span[3], touches: touching.has(row)});
    } else {
      add(!span[3] ? lost : touching.has(row) ? met : known, span);
      if (span[4].length === 2) add(points, span);
    }
  });
  return {obstacles: [known, lost, met, points], outlines};
}

function fill(colour) {
  return `${colour}55`;
}

function drawScene() {
  const shape = (colour, more = {}) => ({x: [], y: [], mode: 'lines', fill: 'toself',
    fillcolor: fill(colour), line: {color: colour, width: 1.4}, hoverinfo: 'text', text: [],
    hoveron: 'points', ...more});
  const trails = recording.footprints.map(({colour}, k) => {
    const body = footprintBody(k);
    const places = body ? body.spans.map(span => bounds(span[4])) : [];
    return {x: places.map(one => one.x), y: places.map(one => one.y), mode: 'lines',
      line: {color: colour, width: 1, dash: 'dot'}, opacity: 0.6, hoverinfo: 'skip'};
  });
  const traces = [
    shape(OBSTACLE), shape(OBSTACLE, {fill: 'none', line: {color: OBSTACLE, width: 1, dash: 'dot'}}),
    shape(CONTACT), {x: [], y: [], mode: 'markers', marker: {color: OBSTACLE, size: 6}},
    ...recording.footprints.map(({colour}) => shape(colour, {line: {color: colour, width: 2}})),
    {x: [], y: [], text: [], mode: 'text', textposition: 'top center', hoverinfo: 'skip',
      textfont: {size: 12, color: INK}},
    ...trails];
  Plotly.react(scene, traces, {...BASE, margin: {l: 64, r: 10, t: 8, b: 42}, dragmode: 'pan',
    hovermode: 'closest', xaxis: {...AXIS, title: {text: 'x [m]', standoff: 4}},
    yaxis: {...AXIS, scaleanchor: 'x', title: {text: 'y [m]', standoff: 8}}},
  {...CONFIG, scrollZoom: true});
}

// Ranges of the axes that show a place and some metres around it.
function ranges(x, y, reach) {
  return {'xaxis.range': [x - reach, x + reach], 'yaxis.range': [y - reach, y + reach]};
}

function lookAtAll() {
  const places = recording.bodies.filter(body => body.footprint !== null)
    .flatMap(body => body.spans.map(span => bounds(span[4])));
  if (!places.length) return {};
  const x = places.map(one => one.x), y = places.map(one => one.y);
  const size = Math.max(...places.map(one => one.size));
  const [x0, x1, y0, y1] = [Math.min(...x), Math.max(...x), Math.min(...y), Math.max(...y)];
  return {'xaxis.range': [x0 - 1.2 * size, x1 + 1.2 * size],
    'yaxis.range': [y0 - 1.2 * size, y1 + 1.2 * size]};
}

function lookAt(footprint, x, y) {
  const body = footprintBody(footprint);
  view.value = String(footprint);
  return ranges(x, y, body ? 1.6 * bounds(body.spans[0][4]).size : 2);
}

// The axes moved as far as the footprint that is followed has moved.
function follow(from, to) {
  const body = footprintBody(Number(view.value));
  const [a, b] = body ? [spanAt(body, from), spanAt(body, to)] : [null, null];
  if (view.value === '' || !a || !b) return {};
  const [one, other] = [bounds(a[4]), bounds(b[4])];
  const moved = (axis, by) => scene.layout[axis].range.map(value => value + by);
  return {'xaxis.range': moved('xaxis', other.x - one.x),
    'yaxis.range': moved('yaxis', other.y - one.y)};
}
