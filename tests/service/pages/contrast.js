// The text on the page that stands out least from what is behind it (WCAG 2.2, 1.4.3).
() => {
  const parse = (text) => {
    const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
    canvas.fillStyle = text; canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  };
  const light = (rgba) => {
    const [r, g, b] = rgba.map((c) => c / 255).map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  let worst = { ratio: 99 };
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || !node.checkVisibility() || node.closest("noscript")) continue;
    let back = [0, 0, 0, 0];
    for (let ground = node; ground && back[3] === 0; ground = ground.parentElement) {
      back = parse(getComputedStyle(ground).backgroundColor);
    }
    const pair = [parse(getComputedStyle(node).color), back].map(light).sort((a, b) => b - a);
    const ratio = (pair[0] + 0.05) / (pair[1] + 0.05);
    if (ratio < worst.ratio) worst = { ratio, text: walker.currentNode.data.trim(), color: getComputedStyle(node).color };
  }
  return worst;
}
