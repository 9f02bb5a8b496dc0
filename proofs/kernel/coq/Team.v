(** Certificates of what Choices.v states: correctness as formulas, which hold of an execution, or contradict each other. *)

Require Import Reals QArith Qreals List Bool PArith ZArith Lra Lia FMapPositive Classical.
Require Import Spec States Kernel Checker Orders Certificate Choices.
Import ListNotations.
Open Scope R_scope.

Section Formulas.
Variable N : team_plan.
Variable epsilon : Q.

Definition whole (n : nat) : Q := inject_Z (Z.of_nat n).

(** A choice has a value; all values of a label; an event is before another one. *)
Definition has (a : nat * nat) : form :=
  let gap := minus (of_var (VPar (fst a))) (whole (snd a), []) in FAnd (FCmp false gap) (FCmp false (minus zero_lin gap)).
Definition label_form (l : label) : form := fall (map has l).
Definition apart_by (a b : nat) (q : Q) : form := FCmp false (minus (minus (of_var (VTime b)) (of_var (VTime a))) (q, [])).
Definition implies (f h : form) : form := FOr (FNot f) h.
Definition when (b : bool) (f : form) : form := if b then f else FTrue.

Definition value_form (c n : nat) : form := fany (map (fun v => has (c, v)) (seq 0 n)).

Definition span_form (s : span) : form :=
  implies (label_form (span_if s)) (FAnd
    (match shortest s with Some q => apart_by (span_from s) (span_until s) q | None => FTrue end)
    (match longest s with Some q => apart_by (span_until s) (span_from s) (- q) | None => FTrue end)).

Definition nat_option_eqb (a b : option nat) : bool :=
  match a, b with Some m, Some n => Nat.eqb m n | None, None => true | _, _ => false end.
Definition is_just_in_time (d : demand) (g : gain) : bool :=
  nat_option_eqb (gained_by g) (needed_by d) && Nat.eqb (gained_at g) (needed_from d) &&
    negb (Nat.eqb (needed_from d) (needed_until d)).
Definition may_produce (d : demand) (g : gain) : bool := Nat.eqb (of_atom g) (about d) && eqb (given g) (wanted d).
Definition may_threaten (d : demand) (g : gain) : bool :=
  Nat.eqb (of_atom g) (about d) && negb (eqb (given g) (wanted d)) &&
    negb (nat_option_eqb (gained_by g) (needed_by d) && Nat.eqb (gained_at g) (needed_until d)).

Definition away_form (d : demand) (g h : gain) : form :=
  implies (label_form (gained_if h))
    (FOr (apart_by (gained_at h) (gained_at g) epsilon) (apart_by (needed_until d) (gained_at h) epsilon)).
Definition producer_form (d : demand) (g : gain) : form :=
  fall (label_form (gained_if g) :: (if is_just_in_time d g then FTrue else apart_by (gained_at g) (needed_from d) epsilon)
    :: map (away_form d g) (filter (may_threaten d) (gains N))).
Definition demand_form (d : demand) : form :=
  implies (label_form (needed_if d)) (fany (map (producer_form d) (filter (may_produce d) (gains N)))).

(** What correctness is. *)
Definition team_forms : list form :=
  map (fun x => value_form (fst x) (snd x)) (combine (seq 0 (length (sizes N))) (sizes N)) ++
  map span_form (spans N) ++ map demand_form (demands N).

Variable x : nat -> nat.
Variable t : nat -> R.
Definition as_values (y : var) : R := match y with VPar c => Q2R (whole (x c)) | VTime e => t e | _ => 0 end.

Lemma whole_R n m : Q2R (whole n) = Q2R (whole m) <-> n = m.
Proof.
  unfold whole. split; [|now intros ->]. intros H. apply eqR_Qeq in H. unfold Qeq, inject_Z in H. simpl in H. lia.
Qed.

Lemma has_true a : fval as_values (has a) <-> x (fst a) = snd a.
Proof.
  unfold has. cbn [fval]. rewrite !minus_at, zero_lin_at, of_var_at, number_at. cbn [as_values above].
  rewrite <- whole_R. lra.
Qed.

Lemma label_true l : fval as_values (label_form l) <-> chosen x l.
Proof.
  unfold label_form, chosen. rewrite fval_all. split.
  - intros H c v I. apply (has_true (c, v)), H, in_map. exact I.
  - intros H f I. apply in_map_iff in I as [[c v] [<- I]]. apply has_true. now apply H.
Qed.

Lemma apart_true a b q : fval as_values (apart_by a b q) <-> Q2R q <= t b - t a.
Proof. unfold apart_by. cbn [fval above]. rewrite !minus_at, !of_var_at, number_at. cbn [as_values]. lra. Qed.

Lemma precedes_true a b : fval as_values (apart_by a b epsilon) <-> precedes epsilon t a b.
Proof. rewrite apart_true. unfold precedes. lra. Qed.

Lemma implies_true v f h : fval v (implies f h) <-> (fval v f -> fval v h).
Proof. unfold implies. rewrite fval_or. cbn [fval]. destruct (classic (fval v f)); tauto. Qed.

Lemma value_true c n : fval as_values (value_form c n) <-> (x c < n)%nat.
Proof.
  unfold value_form. rewrite fval_any. split.
  - intros [f [I T]]. apply in_map_iff in I as [v [<- I]]. apply has_true in T. simpl in T. apply in_seq in I. lia.
  - intros L. exists (has (c, x c)). split; [|now apply has_true]. apply in_map_iff. exists (x c). split; auto. apply in_seq. lia.
Qed.

Lemma span_true s : fval as_values (span_form s) <-> (chosen x (span_if s) -> in_bounds t s).
Proof.
  unfold span_form, in_bounds. rewrite implies_true, label_true. cbn [fval].
  destruct (shortest s), (longest s); rewrite ?apart_true, ?Q2R_opp; cbn [fval];
    split; intros H C; specialize (H C); repeat split; try lra; try tauto.
Qed.

Lemma nat_option_true a b : nat_option_eqb a b = true <-> a = b.
Proof. destruct a, b; simpl; rewrite ?Nat.eqb_eq; split; try congruence; easy. Qed.

Lemma just_in_time_true d g : is_just_in_time d g = true <-> just_in_time d g.
Proof.
  unfold is_just_in_time, just_in_time. rewrite !andb_true_iff, negb_true_iff, nat_option_true, Nat.eqb_eq, Nat.eqb_neq. tauto.
Qed.

Lemma may_produce_true d g : may_produce d g = true <-> of_atom g = about d /\ given g = wanted d.
Proof. unfold may_produce. now rewrite andb_true_iff, Nat.eqb_eq, eqb_true_iff. Qed.

Lemma may_threaten_true d g : threatens x d g <-> may_threaten d g = true /\ chosen x (gained_if g).
Proof.
  unfold threatens, may_threaten. rewrite !andb_true_iff, !negb_true_iff, <- !not_true_iff_false, andb_true_iff, nat_option_true,
    !Nat.eqb_eq, eqb_true_iff. tauto.
Qed.

Lemma away_true d g h : fval as_values (away_form d g h) <->
  (chosen x (gained_if h) -> precedes epsilon t (gained_at h) (gained_at g) \/ precedes epsilon t (needed_until d) (gained_at h)).
Proof. unfold away_form. now rewrite implies_true, label_true, fval_or, !precedes_true. Qed.

Lemma producer_true d g : may_produce d g = true ->
  (fval as_values (producer_form d g) <-> produces N epsilon x t d g).
Proof.
  intros M. apply may_produce_true in M as [A B]. unfold producer_form, produces. cbn [fall fold_right fval].
  change (fold_right FAnd FTrue) with fall. rewrite fval_all, label_true.
  assert (J : fval as_values (if is_just_in_time d g then FTrue else apart_by (gained_at g) (needed_from d) epsilon) <->
    (just_in_time d g \/ precedes epsilon t (gained_at g) (needed_from d))).
  { pose proof (just_in_time_true d g) as E. destruct (is_just_in_time d g); [|rewrite precedes_true]; cbn [fval];
      intuition congruence. }
  rewrite J. split.
  - intros [C [W H]]. repeat split; auto. intros h I T. apply may_threaten_true in T as [T L].
    apply (away_true d g h); auto. apply H, in_map, filter_In. auto.
  - intros [_ [_ [C [W H]]]]. repeat split; auto. intros f I. apply in_map_iff in I as [h [<- I]]. apply filter_In in I as [I T].
    apply away_true. intros L. apply H; auto. apply may_threaten_true. auto.
Qed.

Lemma demand_true d : fval as_values (demand_form d) <->
  (chosen x (needed_if d) -> exists g, In g (gains N) /\ produces N epsilon x t d g).
Proof.
  unfold demand_form. rewrite implies_true, label_true, fval_any. split; intros H C; specialize (H C).
  - destruct H as [f [I T]]. apply in_map_iff in I as [g [<- I]]. apply filter_In in I as [I M]. exists g. split; auto.
    now apply producer_true in T.
  - destruct H as [g [I P]]. assert (M : may_produce d g = true) by (apply may_produce_true; destruct P; tauto).
    exists (producer_form d g). split; [apply in_map, filter_In; auto | now apply producer_true].
Qed.

Lemma numbered_sizes : forall (l : list nat) k c n, In (c, n) (combine (seq k (length l)) l) <-> (k <= c)%nat /\ nth_error l (c - k) = Some n.
Proof.
  induction l as [|m l IH]; intros k c n; simpl.
  - split; [easy|]. intros [_ H]. destruct (c - k)%nat; easy.
  - rewrite IH. split.
    + intros [E|[L H]]; [inversion E; subst; rewrite Nat.sub_diag; auto|].
      split; [lia|]. replace (c - k)%nat with (S (c - S k)) by lia. exact H.
    + intros [L H]. destruct (Nat.eq_dec c k) as [->|D].
      * rewrite Nat.sub_diag in H. simpl in H. left. congruence.
      * right. split; [lia|]. replace (c - k)%nat with (S (c - S k)) in H by lia. exact H.
Qed.

Theorem team_forms_true : (forall f, In f team_forms -> fval as_values f) <-> correct N epsilon x t.
Proof.
  unfold team_forms, correct. split.
  - intros H. split; [|split].
    + intros c n E. apply value_true. apply H. apply in_or_app. left. apply in_map_iff. exists (c, n). split; auto.
      apply numbered_sizes. rewrite Nat.sub_0_r. split; [lia|auto].
    + intros s I. apply span_true. apply H. apply in_or_app. right. apply in_or_app. left. now apply in_map.
    + intros d I. apply demand_true. apply H. apply in_or_app. right. apply in_or_app. right. now apply in_map.
  - intros [V [S D]] f I. apply in_app_or in I as [I|I]; [|apply in_app_or in I as [I|I]]; apply in_map_iff in I as [y [<- I]].
    + destruct y as [c n]. apply numbered_sizes in I as [_ I]. rewrite Nat.sub_0_r in I. apply value_true. now apply V.
    + apply span_true. now apply S.
    + apply demand_true. now apply D.
Qed.
End Formulas.

(** ** There is no correct execution *)

Definition refuted_forms (N : team_plan) (epsilon : Q) (assumed : label) : list form :=
  label_form assumed :: team_forms N epsilon.

Definition check_none (N : team_plan) (epsilon : Q) (assumed : label) (r : refutation) : bool :=
  refutes (M.empty (lin * bool)) (refuted_forms N epsilon assumed) r.

Theorem check_none_sound N epsilon assumed r : check_none N epsilon assumed r = true -> no_execution N epsilon assumed.
Proof.
  intros H x t C K. apply (refutes_false (as_values x t)) in H; auto.
  - intros n e s F. rewrite M.gempty in F. easy.
  - intros f [<-|I]; [now apply label_true|]. revert f I. now apply team_forms_true.
Qed.

(** ** An execution is correct *)

Definition form_value (value : var -> Q) (e : lin) : Q :=
  fold_right (fun y q => Qred (snd y * value (fst y) + q)) (fst e) (snd e).

Fixpoint fvalue (value : var -> Q) (f : form) : bool :=
  match f with
  | FTrue => true
  | FCmp s e => sure s (form_value value e)
  | FNot f => negb (fvalue value f)
  | FAnd f h => fvalue value f && fvalue value h
  end.

Lemma form_value_at value e : Q2R (form_value value e) = at_ (fun y => Q2R (value y)) e.
Proof.
  destruct e as [q l]. unfold form_value, at_, terms_at. cbn [fst snd]. induction l as [|[y r] l IH]; simpl; [lra|].
  rewrite Q2R_red, Q2R_plus, Q2R_mult, IH. simpl. lra.
Qed.

Lemma fvalue_true value f : fvalue value f = true <-> fval (fun y => Q2R (value y)) f.
Proof.
  induction f as [| s e | f IH | f IHf h IHh]; simpl.
  - tauto.
  - rewrite <- form_value_at. unfold sure. destruct s; simpl; [apply positive_q_dec | apply Qle_bool_R].
  - now rewrite negb_true_iff, <- not_true_iff_false, IH.
  - now rewrite andb_true_iff, IHf, IHh.
Qed.

(** The numbers of the values that choices have, and the times of events. *)
Definition check_execution (N : team_plan) (epsilon : Q) (values : list nat) (times : list Q) : bool :=
  let value := fun y => match y with VPar c => whole (nth c values 0%nat) | VTime e => nth e times 0%Q | _ => 0%Q end in
  forallb (fvalue value) (team_forms N epsilon).

Lemma fval_ext v w f : (forall y, v y = w y) -> (fval v f <-> fval w f).
Proof.
  intros A. induction f as [| s [q l] | f IH | f IHf h IHh]; simpl; try tauto. unfold at_, terms_at. simpl.
  enough (E : sum (fun x => Q2R (snd x) * v (fst x)) l = sum (fun x => Q2R (snd x) * w (fst x)) l) by now rewrite E.
  induction l as [|[y r] l IH]; simpl; auto. now rewrite A, IH.
Qed.

Theorem check_execution_sound N epsilon values times : check_execution N epsilon values times = true ->
  correct N epsilon (fun c => nth c values 0%nat) (fun e => Q2R (nth e times 0%Q)).
Proof.
  unfold check_execution. rewrite forallb_forall. intros H. apply team_forms_true. intros f I. apply H, fvalue_true in I.
  revert I. apply fval_ext. intros []; unfold as_values; auto using zero_R.
Qed.
