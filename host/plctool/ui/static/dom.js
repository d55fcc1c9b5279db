// Elements. Names, values and logs come from devices: they are text, never markup.

export const byId = (id) => document.getElementById(id);

// Returns a new element with a class, and text or elements in it.
export function element(tag, name = "", ...content) {
  const made = document.createElement(tag);
  if (name) made.className = name;
  made.append(...content.map((part) => (part instanceof Node ? part : String(part))));
  return made;
}

// Sets the text of an element if it differs, so that a selection in it lasts.
export function setText(node, text) {
  if (node.textContent !== text) node.textContent = text;
}
