// The page, from top to bottom. A part that fails says so and leaves the others alone.

// What `build` returns; a warning instead where it fails.
function attempted(build) {
  try {
    return build();
  } catch (error) {
    console.error(error);
    return [make('p', { class: 'warning' }, `This part could not be shown: ${error.message}`)];
  }
}

function addSections() {
  const contents = document.getElementById('contents'), main = document.getElementById('main');
  for (const { id, title, heading, build } of pageParts) {
    const section = make('section', { id, 'aria-label': title }, make('h2', {}, heading || title));
    main.append(section);
    const content = attempted(build);
    if (content === null) {
      section.remove();
      continue;
    }
    filled(section, {}, content);
    contents.append(make('a', { href: `#${id}` }, title));
  }
}

document.getElementById('head').append(...(attempted(drawHead) || []));
addSections();
