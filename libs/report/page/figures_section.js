// Figures of benches: lines through points, each series with a sign and a dash of its own, and its numbers.

function figureParts(figure) {
  const every = figure.series.flatMap((one) => one.points.map(([x]) => x)), least = Math.min(...every), most = Math.max(...every);
  const series = figure.series.map((one, i) => ({ name: one.name, look: lookOf(i), sign: i, x: one.points.map(([x]) => x), y: one.points.map(([, y]) => y) }));
  const numbers = figure.series.flatMap((one) => one.points.map(([x, y]) => [one.name, tickText(x), tickText(y)]));
  return [make('h3', {}, figure.title), lineChart(series, figure.x, figure.y, { logX: least > 0 && most > 10 * least, logY: figure.log_y }),
    make('div', { class: 'key' }, series.map((one, i) => make('span', {}, sample(one.look), signSample(i), ' ', one.name))),
    make('details', {}, make('summary', {}, 'Numbers'), make('div', {}, table(['Series', `#${figure.x}`, `#${figure.y}`], numbers)))];
}

const drawHead = () => [make('p', { class: 'outcome' }, `${counted(run.benches.reduce((sum, bench) => sum + bench.figures.length, 0), 'figure')} of ${counted(run.benches.length, 'bench', 'benches')}.`)];
const pageParts = [...run.benches.map((bench, i) => ({ id: `bench-${i}`, title: bench.name,
  build: () => [make('p', { class: 'soft' }, `Measured on ${bench.machine}, at ${bench.commit}.`), ...bench.figures.flatMap(figureParts)] })),
  { id: 'again', title: 'Make it again', build: () => againSection('the same figures') }];
