// Keeps the page for visits without a network.

const CACHE = "hog-lab-1";
const FILES = ["./", "index.html", "style.css", "lab.js", "engine.js", "panels.js", "sample.js", "en.json",
  new URL(location).searchParams.get("module"), "limo_64x128.f32", "limo_48x96.f32"];

addEventListener("install", (event) => event.waitUntil(caches.open(CACHE).then((cache) => cache.addAll(FILES))));
addEventListener("activate", (event) => event.waitUntil(clients.claim()));
addEventListener("fetch", (event) => {
  const kept = () => caches.match(event.request, { ignoreSearch: true });
  const asked = fetch(event.request).then(async (answer) => {
    if (answer.ok) await (await caches.open(CACHE)).put(event.request, answer.clone());
    return answer;
  });
  event.respondWith(asked.catch(kept));
});
