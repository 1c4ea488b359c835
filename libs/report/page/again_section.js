// How to make what the page shows again: commands, inputs, versions.

// same: what the same inputs give.
function againSection(same) {
  const commands = make('pre', { tabindex: 0 }, make('code', {}, run.commands.join('\n')));
  const inputs = run.inputs.length > 0 ? [make('h3', {}, 'Inputs'), table(['Path', 'SHA-256'], run.inputs.map((input) => [make('code', {}, input.path), make('code', {}, input.sha256)]))] : [];
  const versions = Object.entries(run.versions), known = versions.length > 0 ? [make('h3', {}, 'Versions'), table(['Part', 'Version'], versions)] : [];
  return [...(run.commands.length > 0 ? [commands] : [make('p', {}, 'manifest.json is missing: how the folder was made is not known.')]),
    isNumber(run.seed) ? make('p', {}, `Seed ${run.seed}. The same inputs give ${same}.`) : null, ...inputs, ...known].filter(Boolean);
}
