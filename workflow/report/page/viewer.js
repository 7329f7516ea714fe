// The report's 3D view: a run beside the measured brains, turned together, moved through the weeks.
"use strict";
(function () {
  const data = JSON.parse(document.getElementById("surfaces").textContent);
  const place = document.getElementById("view3d");
  if (!place || !data.groups.length) return;

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const wholes = (text) => new Uint16Array(bytes(text).buffer);
  const UNKNOWN = 255, GREY = [0.72, 0.72, 0.72];

  const simulated = data.groups.filter((group) => group.kind === "simulated");
  const observed = data.groups.find((group) => group.kind === "observed");
  const maps = data.maps.map((map) => ({ ...map, colours: bytes(map.colours) }));
  const weeks = data.groups.flatMap((group) => group.frames.map((frame) => frame.week));
  const first = Math.min(...weeks), last = Math.max(...weeks);

  // --- surfaces -------------------------------------------------------------------------------
  const positionsOf = (frame) => {
    if (!frame.places) {
      const levels = wholes(frame.positions);
      frame.places = new Float32Array(levels.length);
      for (let i = 0; i < levels.length; i++) frame.places[i] = data.low[i % 3] + (levels[i] / 65535) * data.size;
    }
    return frame.places;
  };
  const levelsOf = (frame, name) => {
    frame.levels = frame.levels || {};
    if (!(name in frame.levels)) frame.levels[name] = frame.values[name] ? bytes(frame.values[name]) : null;
    return frame.levels[name];
  };
  const around = (group, week) => {
    const frames = group.frames;
    let next = frames.findIndex((frame) => frame.week >= week - 1e-6);
    if (next < 0) next = frames.length - 1;
    const before = Math.max(0, Math.abs(frames[next].week - week) < 1e-6 ? next : next - 1);
    const span = frames[next].week - frames[before].week;
    const part = span > 0 ? Math.min(1, Math.max(0, (week - frames[before].week) / span)) : 0;
    return [frames[before], frames[next], part];
  };
  const nearest = (group, week) =>
    group.frames.reduce((a, b) => (Math.abs(b.week - week) < Math.abs(a.week - week) - 1e-6 ? b : a));

  const material = () =>
    new THREE.MeshPhongMaterial({ vertexColors: true, side: THREE.DoubleSide, shininess: 8, specular: 0x111111 });
  const lit = (scene) => {
    scene.background = new THREE.Color(0xffffff);
    scene.add(new THREE.AmbientLight(0xffffff, 0.5));
  };

  class Pane {
    constructor() {
      this.scene = new THREE.Scene();
      lit(this.scene);
      this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), material());
      this.mesh.frustumCulled = false;
      this.scene.add(this.mesh);
      this.shown = null;
    }
    triangles(owner, places) {
      if (this.shown === owner) return;
      this.mesh.geometry.dispose();
      const geometry = new THREE.BufferGeometry();
      geometry.setIndex(new THREE.BufferAttribute(wholes(owner.faces), 1));
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(places.length), 3));
      geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(places.length), 3));
      this.mesh.geometry = geometry;
      this.shown = owner;
    }
    paint(colour, map, levelsA, levelsB, part) {
      const colours = this.mesh.geometry.attributes.color, plain = new THREE.Color(colour);
      for (let i = 0; i < colours.count; i++) {
        if (!map) { colours.setXYZ(i, plain.r, plain.g, plain.b); continue; }
        if (!levelsA || levelsA[i] === UNKNOWN || levelsB[i] === UNKNOWN) { colours.setXYZ(i, ...GREY); continue; }
        const level = 3 * Math.round(levelsA[i] * (1 - part) + levelsB[i] * part);
        colours.setXYZ(i, map.colours[level] / 255, map.colours[level + 1] / 255, map.colours[level + 2] / 255);
      }
      colours.needsUpdate = true;
    }
    run(group, week, map) {
      const [a, b, part] = around(group, week), from = positionsOf(a), to = positionsOf(b);
      this.triangles(group, from);
      const places = this.mesh.geometry.attributes.position;
      for (let i = 0; i < from.length; i++) places.array[i] = from[i] * (1 - part) + to[i] * part;
      places.needsUpdate = true;
      this.paint(group.colour, map, map && levelsOf(a, map.name), map && levelsOf(b, map.name), part);
      this.mesh.geometry.computeVertexNormals();
      return Math.min(Math.max(week, group.frames[0].week), group.frames[group.frames.length - 1].week);
    }
    brain(group, week, map) {
      const frame = nearest(group, week), places = positionsOf(frame);
      this.triangles(frame, places);
      this.mesh.geometry.attributes.position.array.set(places);
      this.mesh.geometry.attributes.position.needsUpdate = true;
      const levels = map && levelsOf(frame, map.name);
      this.paint(group.colour, map, levels, levels, 0);
      this.mesh.geometry.computeVertexNormals();
      return frame.week;
    }
  }

  // --- camera, light, controls ------------------------------------------------------------------
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ antialias: true, preserveDrawingBuffer: true });
  } catch (error) {
    place.textContent = "This browser has no WebGL: the surfaces cannot be shown.";
    return;
  }
  renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
  renderer.setScissorTest(true);
  place.appendChild(renderer.domElement);
  const camera = new THREE.OrthographicCamera(-1, 1, 1, -1, 1, 2000);
  const lamps = new THREE.Group();
  for (const [x, y, z, strength] of [[0, 1, 0.8, 0.14], [-1, 0.2, 0.5, 0.16], [1, 0.2, 0.5, 0.16], [0, 0, 1, 0.3]]) {
    const lamp = new THREE.DirectionalLight(0xffffff, strength);
    lamp.position.set(x, y, z);
    lamp.add(lamp.target);
    lamp.target.position.set(-x, -y, -z);
    lamps.add(lamp);
  }
  const panes = observed && simulated.length ? [new Pane(), new Pane()] : [new Pane()];
  const centre = new THREE.Vector3();
  const half = data.size * 0.52;
  const controls = new THREE.OrbitControls(camera, renderer.domElement);
  controls.enableDamping = false;
  controls.enablePan = false;
  const VIEWS = { left: [-1, 0, 0], right: [1, 0, 0], top: [0, -0.0001, 1], bottom: [0, -0.0001, -1], front: [0, 1, 0], back: [0, -1, 0] };
  camera.up.set(0, 0, 1);
  const look = (name) => {
    camera.position.copy(centre).addScaledVector(new THREE.Vector3(...VIEWS[name]).normalize(), data.size * 4);
    controls.target.copy(centre);
    camera.zoom = 1;
    camera.updateProjectionMatrix();
    controls.update();
  };

  // --- the parts of the page ---------------------------------------------------------------------
  const find = (name) => document.getElementById(name);
  const runs = find("view-run"), chosen = find("view-map"), slider = find("view-week"), said = find("view-said");
  const titles = [find("view-title-0"), find("view-title-1")];
  const option = (into, value, text) => { const made = document.createElement("option"); made.value = value; made.textContent = text; into.appendChild(made); };
  simulated.forEach((group, index) => option(runs, index, group.name));
  option(chosen, "", "plain surface");
  maps.forEach((map) => option(chosen, map.name, map.label));
  if (simulated.length < 2) runs.closest("label").hidden = simulated.length === 0;
  slider.min = first; slider.max = last; slider.step = 0.05;
  slider.value = simulated.length ? simulated[0].frames[simulated[0].frames.length - 1].week : last;
  const ticks = find("view-weeks");
  [...new Set(weeks)].sort((a, b) => a - b).forEach((week) => option(ticks, week, week));

  const bar = find("view-bar");
  const drawBar = (map) => {
    bar.parentElement.hidden = !map;
    if (!map) return;
    const context = bar.getContext("2d");
    for (let x = 0; x < bar.width; x++) {
      const level = 3 * Math.round((x / (bar.width - 1)) * 254);
      context.fillStyle = `rgb(${map.colours[level]},${map.colours[level + 1]},${map.colours[level + 2]})`;
      context.fillRect(x, 0, 1, bar.height);
    }
    const short = (value) => String(Number(value.toPrecision(3))).replace("-", "−");
    find("view-low").textContent = short(map.low);
    find("view-high").textContent = short(map.high);
    find("view-label").textContent = map.label;
  };

  // the ends of the axes that lie in the picture, at the edges of each pane, and a bar of whole millimetres
  const ENDS = { L: [-1, 0, 0], R: [1, 0, 0], P: [0, -1, 0], A: [0, 1, 0], I: [0, 0, -1], S: [0, 0, 1] };
  const SEEN = 0.6, TO_EDGE = 0.44;
  const mark = (each, height, wide) => {
    const ends = find("view-ends"), bar = find("view-scale").firstElementChild;
    ends.replaceChildren();
    const back = camera.quaternion.clone().conjugate();
    panes.forEach((_, index) => {
      for (const [letter, axis] of Object.entries(ENDS)) {
        const seen = new THREE.Vector3(...axis).applyQuaternion(back), size = Math.hypot(seen.x, seen.y);
        if (size < SEEN) continue;
        const said = document.createElement("span"), scale = TO_EDGE / Math.max(Math.abs(seen.x), Math.abs(seen.y));
        said.textContent = letter;
        said.style.left = `${each * (index + 0.5 + seen.x * scale)}px`;
        said.style.top = `${height * (0.5 - seen.y * scale)}px`;
        ends.appendChild(said);
      }
    });
    const perMm = (camera.zoom * each) / (2 * wide), length = [50, 20, 10, 5, 2, 1].find((mm) => mm * perMm < 0.3 * each) || 1;
    bar.style.width = `${length * perMm}px`;
    bar.textContent = `${length} mm`;
  };

  const state = { frames: 0 };
  const draw = () => {
    const width = place.clientWidth, height = Math.round(Math.min(0.62 * width / panes.length * 1.15, 560));
    renderer.setSize(width, height);
    const each = width / panes.length, wide = half * (each / height > 1 ? each / height : 1);
    const tall = wide * height / each;
    camera.left = -wide; camera.right = wide; camera.top = tall; camera.bottom = -tall;
    camera.updateProjectionMatrix();
    lamps.quaternion.copy(camera.quaternion);
    panes.forEach((pane, index) => {
      pane.scene.add(lamps);
      lamps.updateMatrixWorld(true);
      renderer.setViewport(index * each, 0, each, height);
      renderer.setScissor(index * each, 0, each, height);
      renderer.render(pane.scene, camera);
    });
    mark(each, height, wide);
    state.frames += 1;
  };
  const show = () => {
    const week = Number(slider.value), map = maps.find((each) => each.name === chosen.value) || null;
    const shown = [];
    let pane = 0;
    if (simulated.length) {
      const group = simulated[Number(runs.value) || 0];
      shown.push([`${group.name}, simulated`, panes[pane].run(group, week, map)]);
      pane += 1;
    }
    if (observed && panes[pane]) shown.push([observed.name, panes[pane].brain(observed, week, map)]);
    shown.forEach(([name, at], index) => { titles[index].textContent = `${name}: ${Number(at.toFixed(2))} GW`; });
    said.textContent = `${Number(week.toFixed(2))} GW`;
    drawBar(map);
    draw();
  };
  // the middle of the last surfaces
  const box = new THREE.Box3();
  data.groups.forEach((group) => {
    const places = positionsOf(group.frames[group.frames.length - 1]);
    for (let i = 0; i < places.length; i += 3) box.expandByPoint(new THREE.Vector3(places[i], places[i + 1], places[i + 2]));
  });
  box.getCenter(centre);

  let playing = null;
  const stop = () => { clearInterval(playing); playing = null; find("view-play").textContent = "play"; };
  find("view-play").addEventListener("click", () => {
    if (playing) { stop(); return; }
    find("view-play").textContent = "stop";
    if (Number(slider.value) >= last - 1e-6) slider.value = first;
    playing = setInterval(() => {
      slider.value = Number(slider.value) + 0.05;
      show();
      if (Number(slider.value) >= last - 1e-6) stop();
    }, 60);
  });
  [runs, chosen].forEach((each) => each.addEventListener("change", show));
  slider.addEventListener("input", show);
  document.querySelectorAll("[data-look]").forEach((button) =>
    button.addEventListener("click", () => { look(button.dataset.look); draw(); }));
  controls.addEventListener("change", draw);
  window.addEventListener("resize", draw);
  look("left");
  show();
  window.view3d = { camera, state, slider };
})();
