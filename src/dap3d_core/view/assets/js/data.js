// What Python wrote into the page. Arrays are base64 of little-endian numbers.

const DATA = JSON.parse(document.getElementById("data").textContent);
const element = (id) => document.getElementById(id);

function bytes(text) {
  const raw = atob(text);
  const out = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) out[k] = raw.charCodeAt(k);
  return out.buffer;
}

const float32 = (text) => new Float32Array(bytes(text));
const float64 = (text) => new Float64Array(bytes(text));
const uint32 = (text) => new Uint32Array(bytes(text));

// A new element of the document, with text (never read as HTML) and attributes.
function make(tag, text = "", attributes = {}, ...children) {
  const made = document.createElement(tag);
  if (text !== "") made.textContent = text;
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "style") made.style.cssText = value; // as an attribute the page's policy forbids it
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

// A number in few characters: 4 significant digits.
function short(x) {
  if (!Number.isFinite(x)) return String(x);
  const size = Math.abs(x);
  if (size === 0) return "0";
  if (size < 1e-3 || size >= 1e5) return x.toExponential(2).replace("e+", "e");
  return String(Number(x.toPrecision(4)));
}

// The numbers 1, 2, 5 times a power of ten: the largest not above x.
function niceBelow(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  for (const factor of [5, 2, 1]) if (factor * power <= x * (1 + 1e-9)) return factor * power;
  return power;
}

const unitText = (unit) => ({ 1: "", SI: "SI units" })[unit] ?? unit.replaceAll("^2", "\u00b2").replaceAll("^3", "\u00b3");

// Okabe and Ito (2008); the first colours are the most different ones.
const PALETTE = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"];
